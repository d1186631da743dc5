// A loop in a large map: what it costs to take it in, and what the map is worth then.
#include <algorithm>
#include <cmath>
#include <ctime>
#include <numbers>

#include <catch2/catch.hpp>

#include "backend/backend.h"
#include "cameras/geometry/se3.h"
#include "test/support/random.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {
namespace {

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// A stereo pair flies one lap of a large circle and a little more, over ground of which it sees
// some points for a few keyframes each. The map grows as the pipeline grows it; where the lap ends,
// it holds the ground a second time.
class Lap {
 public:
  explicit Lap(std::size_t keyframes) : keyframes_(keyframes) {
    backend_.add_camera(camera_);
    for (std::size_t i = 0; i < keyframes; ++i) add_ground(i);
    first_.resize(ground_.size());
    second_.resize(ground_.size());
    for (std::size_t i = 0; i < keyframes + kOverlap; ++i) add_keyframe(i);
  }

  Backend& backend() { return backend_; }

  // What a verification of the newest keyframe against the same place of the lap's start measures.
  LoopMeasurement loop() {
    LoopMeasurement loop;
    const std::size_t last = ids_.size() - 1;
    loop.keyframe = ids_[last];
    loop.match = ids_[last - keyframes_];
    Vector6d off;
    off << random_.gaussian3(0.005), random_.gaussian3(0.002);
    loop.keyframe_from_match =
        Sim3d(se3_exp(off) * pose_at(last) * inverse(pose_at(last - keyframes_)));
    for (std::size_t p = 0; p < ground_.size(); ++p) {
      if (there(first_[p]) && there(second_[p])) loop.same.push_back({first_[p], second_[p]});
    }
    return loop;
  }

  // After the loop: on the ground that is known twice no more.
  KeyframeId go_on() {
    merged_ = true;
    add_keyframe(ids_.size());
    return ids_.back();
  }

  double error_at_the_end() const {
    const Rigid3d& estimate = backend_.view().at(ids_.back()).cam_from_world;
    return (origin_in_a(estimate) - origin_in_a(pose_at(ids_.size() - 1))).norm();
  }

  double last_update() const { return last_update_; }  // CPU [s]

 private:
  static constexpr std::size_t kOverlap = 12;  // keyframes beyond the lap
  static constexpr std::size_t kNewPoints = 14;
  static constexpr std::size_t kSeenFor = 4;
  static constexpr double kStep = 0.3;   // [m]
  static constexpr double kNoise = 0.3;  // [px]

  bool there(LandmarkId id) const { return id.valid() && backend_.view().find(id) != nullptr; }

  Rigid3d pose_at(std::size_t i) const {
    const double angle =
        2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(keyframes_);
    const double radius = kStep * static_cast<double>(keyframes_) / (2 * std::numbers::pi);
    // Looks down; x forward.
    const Eigen::Vector3d at(radius * std::sin(angle), radius * (1 - std::cos(angle)),
                             0.2 * std::sin(5 * angle));
    const Eigen::Quaterniond turned(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
    return inverse(Rigid3d(turned, at));
  }

  // Before the camera where it will be kSeenFor / 2 keyframes later.
  void add_ground(std::size_t i) {
    const Rigid3d world_from_cam = inverse(pose_at(i));
    for (std::size_t k = 0; k < kNewPoints; ++k) {
      const Eigen::Vector3d in_cam(random_.uniform(-1.5, 1.5), random_.uniform(-1.2, 1.2),
                                   random_.uniform(2.5, 4));
      ground_.push_back(world_from_cam * in_cam);
      ground_at_.push_back(i);
    }
  }

  void add_keyframe(std::size_t i) {
    const Rigid3d truth = pose_at(i);
    NewKeyframe made;
    if (i > 0) {
      Vector6d off;
      off << random_.gaussian3(0.003), random_.gaussian3(0.001);
      const Rigid3d motion = se3_exp(off) * truth * inverse(pose_at(i - 1));
      made.cam_from_world = motion * backend_.view().at(ids_.back()).cam_from_world;
      made.reference = ids_.back();
    }
    auto frame = std::make_shared<FrameObservations>();
    frame->camera = CameraId(0);
    frame->frame_index = static_cast<std::int64_t>(i);
    frame->features.kind = DescriptorKind::kSynthetic;
    std::vector<LandmarkId>& known = i < keyframes_ ? first_ : second_;
    std::vector<std::size_t> seen;
    for (std::size_t k = 0; k < kSeenFor; ++k) {
      const std::size_t from = (i + keyframes_ - k) % keyframes_;
      if (i < keyframes_ && k > i) continue;
      for (std::size_t p = from * kNewPoints; p < (from + 1) * kNewPoints; ++p) {
        observe(p, truth, *frame, seen);
      }
    }
    frame->features.descriptors.resize(frame->features.keypoints.size());
    made.landmarks.resize(frame->size());
    for (std::uint32_t k = 0; k < seen.size(); ++k) {
      const std::size_t p = seen[k];
      // What is seen across the lap's end has been seen all the time.
      const bool carried = i >= keyframes_ && ground_at_[p] + kSeenFor >= keyframes_;
      made.landmarks[k] = carried || merged_ ? first_[p] : known[p];
      if (there(made.landmarks[k])) continue;
      made.landmarks[k] = LandmarkId();
      const Keypoint& keypoint = frame->features.keypoints[k];
      const auto in_cam = triangulate_stereo(camera_, {keypoint.x, keypoint.y, frame->u_right[k]});
      if (in_cam) made.new_points.emplace_back(k, inverse(made.cam_from_world) * *in_cam);
    }
    made.observations = frame;
    const KeyframeId id = backend_.add(made);
    for (std::uint32_t k = 0; k < seen.size(); ++k) {
      const LandmarkId landmark = backend_.view().at(id).landmarks[k];
      if (landmark.valid() && landmark != first_[seen[k]]) {
        (merged_ ? first_ : known)[seen[k]] = landmark;
      }
    }
    ids_.push_back(id);
    const double start = cpu_seconds();
    backend_.optimize_local(id);
    last_update_ = cpu_seconds() - start;
  }

  void observe(std::size_t p, const Rigid3d& truth, FrameObservations& frame,
               std::vector<std::size_t>& seen) {
    const Eigen::Vector3d in_cam = truth * ground_[p];
    Eigen::Vector3d m;
    if (!RectifiedStereo::project(camera_.params.data(), in_cam.data(), m.data())) return;
    if (!in_image(camera_, m.head<2>())) return;
    for (double& x : m) x += kNoise * random_.gaussian();
    Keypoint keypoint;
    keypoint.x = static_cast<float>(m[0]);
    keypoint.y = static_cast<float>(m[1]);
    keypoint.scale = 1;
    keypoint.sigma = static_cast<float>(kNoise);
    frame.features.keypoints.push_back(keypoint);
    frame.u_right.push_back(static_cast<float>(m[2]));
    seen.push_back(p);
  }

  std::size_t keyframes_;  // of the lap
  Calibrated<RectifiedStereo> camera_ = synthetic_stereo_camera(0.2);
  BackendOptions options_;
  Backend backend_{options_};
  Random random_{5};
  bool merged_ = false;
  std::vector<Eigen::Vector3d> ground_;
  std::vector<std::size_t> ground_at_;  // keyframe below which it lies
  std::vector<LandmarkId> first_;       // by point of the ground
  std::vector<LandmarkId> second_;      // likewise, on the second lap
  std::vector<KeyframeId> ids_;
  double last_update_ = 0;
};

// How far the map's cost is above that of the batch optimum, of all observations that it has.
double above_batch(const MapSnapshot& map) {
  FullBundleOptions options;
  options.problem.rounds = {{30, Loss::kHuber, 1e-9}};
  options.max_keyframes = map.keyframe_count();
  const BundleSummary summary = solve_full(map, options).summary;
  return summary.initial_cost / summary.final_cost - 1;
}

void check_loop(std::size_t keyframes) {
  Lap lap(keyframes);
  const double drifted = lap.error_at_the_end();
  const LoopMeasurement loop = lap.loop();
  REQUIRE(loop.same.size() > 50);
  double start = cpu_seconds();
  REQUIRE(lap.backend().close(loop).end == LoopEnd::kClosed);
  const double closing = cpu_seconds() - start;
  start = cpu_seconds();
  lap.backend().optimize_local(loop.keyframe);
  const double first = cpu_seconds() - start;
  double worst = 0;
  for (int i = 0; i < 20; ++i) {
    if (i == 2) {  // after three updates, of which the map knows all
      lap.backend().catch_up();
      CHECK(above_batch(lap.backend().view()) < 0.01);
    }
    lap.go_on();
    worst = std::max(worst, lap.last_update());
  }
  WARN(keyframes << " keyframes, " << drifted << " m off: loop graph " << 1e3 * closing
                 << " ms, the update that takes it in " << 1e3 * first << " ms, the slowest after "
                 << 1e3 * worst << " ms, then " << lap.error_at_the_end() << " m off");
  CHECK(lap.error_at_the_end() < 0.1);
  CHECK(lap.backend().map().check_consistency() == std::vector<std::string>{});
}

TEST_CASE("A loop in a map of 200 keyframes is one edit of the smoother") { check_loop(200); }

TEST_CASE("A loop in a map of 2000 keyframes is one edit of the smoother", "[slow]") {
  check_loop(2000);
}

}  // namespace
}  // namespace hybrid_slam
