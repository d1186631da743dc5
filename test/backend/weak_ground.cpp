#include "test/backend/weak_ground.h"

#include <Eigen/Cholesky>

#include "cameras/geometry/se3.h"
#include "cameras/geometry/uncertain_motion.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

namespace {

constexpr std::size_t kNewPoints = 30;  // of each keyframe
constexpr std::size_t kSeenFor = 3;     // keyframes from its birth on

Calibrated<RectifiedStereo> camera() { return synthetic_stereo_camera(0.2); }

}  // namespace

Matrix6d weak_ground_covariance() {
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(WeakGround::kTranslationSigma),
      Eigen::Vector3d::Constant(WeakGround::kRotationSigma);
  return sigma.cwiseAbs2().asDiagonal();
}

GrownWeakGround::GrownWeakGround(const WeakGround& options, Backend& backend)
    : options_(options), random_(options.seed) {
  backend.add_camera(camera());
  for (std::size_t i = 0; i < WeakGround::kKeyframes; ++i) add_keyframe(i, backend);
}

// Before the camera, from 3 m to 8 m away.
std::vector<Eigen::Vector3d> GrownWeakGround::new_points(std::size_t index) {
  const Calibrated<RectifiedStereo> stereo = camera();
  std::vector<Eigen::Vector3d> made;
  while (made.size() < kNewPoints) {
    const Eigen::Vector3d in_cam(random_.uniform(-3, 3), random_.uniform(-2, 2),
                                 random_.uniform(3, 8));
    const auto seen = project(Camera(stereo), in_cam);
    if (!seen || !in_image(stereo, seen->head<2>())) continue;
    made.push_back(inverse(truth_[index]) * in_cam);
  }
  return made;
}

void GrownWeakGround::add_keyframe(std::size_t index, Backend& backend) {
  const Calibrated<RectifiedStereo> stereo = camera();
  const double step = 0.3 * static_cast<double>(index);
  const Rigid3d turn(Eigen::Quaterniond(Eigen::AngleAxisd(0.02 * static_cast<double>(index),
                                                          Eigen::Vector3d(1, 3, -1).normalized())),
                     Eigen::Vector3d::Zero());
  truth_.push_back(turn * inverse(Rigid3d(Eigen::Quaterniond::Identity(), {step, 0, 0.1 * step})));
  const Rigid3d& cam_from_world = truth_.back();
  for (const Eigen::Vector3d& point : new_points(index)) {
    const bool across = index + 1 == WeakGround::kWeak &&
                        born_at_.size() < index * kNewPoints + std::size_t(options_.shared);
    points_.push_back(point);
    landmarks_.emplace_back();
    born_at_.push_back(index);
    shared_.push_back(across ? 1 : 0);
  }
  NewKeyframe made;
  made.cam_from_world = Rigid3d();
  if (index > 0) {
    // d = sigma * gaussian in exp(d) * motion.
    Vector6d off;
    off << random_.gaussian3(WeakGround::kTranslationSigma),
        random_.gaussian3(WeakGround::kRotationSigma);
    const Rigid3d measured = se3_exp(off) * cam_from_world * inverse(truth_[index - 1]);
    made.reference = keyframes_.back();
    made.cam_from_world = measured * backend.view().at(keyframes_.back()).cam_from_world;
    if (options_.with_odometry) {
      Odometry odometry{keyframes_.back(), {measured, weak_ground_covariance()}, {}};
      for (std::uint32_t k = 0; k < WeakGround::kOdometerMatches; ++k)
        odometry.keypoints.push_back(k);
      made.odometry = std::make_shared<const Odometry>(std::move(odometry));
    }
  }
  auto frame = std::make_shared<FrameObservations>();
  frame->camera = CameraId(0);
  frame->frame_index = static_cast<std::int64_t>(index);
  std::vector<std::size_t> seen;
  for (std::size_t p = 0; p < points_.size(); ++p) {
    const bool crosses = born_at_[p] < WeakGround::kWeak && index >= WeakGround::kWeak;
    if (crosses && shared_[p] == 0) continue;
    if (!crosses && born_at_[p] + kSeenFor <= index) continue;
    if (crosses && index > WeakGround::kWeak) continue;
    const Eigen::Vector3d in_cam = cam_from_world * points_[p];
    Eigen::Vector3d m;
    if (!RectifiedStereo::project(stereo.params.data(), in_cam.data(), m.data())) continue;
    for (double& x : m) x += WeakGround::kNoise * random_.gaussian();
    Keypoint keypoint;
    keypoint.x = static_cast<float>(m[0]);
    keypoint.y = static_cast<float>(m[1]);
    keypoint.scale = 1;
    keypoint.sigma = static_cast<float>(WeakGround::kNoise);
    frame->features.keypoints.push_back(keypoint);
    frame->u_right.push_back(static_cast<float>(m[2]));
    seen.push_back(p);
  }
  // What the odometer followed and the map does not have.
  while (frame->features.keypoints.size() < WeakGround::kOdometerMatches) {
    frame->features.keypoints.push_back({});
    frame->features.keypoints.back().sigma = 1;
    frame->u_right.push_back(kNoRightMatch);
  }
  frame->features.descriptors.resize(frame->features.keypoints.size());
  frame->features.kind = DescriptorKind::kSynthetic;
  made.landmarks.resize(frame->size());
  for (std::uint32_t k = 0; k < seen.size(); ++k) {
    made.landmarks[k] = landmarks_[seen[k]];
    if (made.landmarks[k].valid()) continue;
    const Keypoint& keypoint = frame->features.keypoints[k];
    const auto in_cam = triangulate_stereo(stereo, {keypoint.x, keypoint.y, frame->u_right[k]});
    if (in_cam) made.new_points.emplace_back(k, inverse(made.cam_from_world) * *in_cam);
  }
  made.observations = frame;
  const KeyframeId id = backend.add(made);
  for (std::uint32_t k = 0; k < seen.size(); ++k) {
    landmarks_[seen[k]] = backend.view().at(id).landmarks[k];
  }
  keyframes_.push_back(id);
  backend.optimize_local(id);
}

double GrownWeakGround::mahalanobis2(const MapSnapshot& map) const {
  constexpr std::size_t kWeak = WeakGround::kWeak;
  const Rigid3d estimate = map.at(keyframes_[kWeak]).cam_from_world *
                           inverse(map.at(keyframes_[kWeak - 1]).cam_from_world);
  const Rigid3d motion = truth_[kWeak] * inverse(truth_[kWeak - 1]);
  const Vector6d off = se3_log(estimate * inverse(motion));
  return squared_mahalanobis(off, weak_ground_covariance());
}

}  // namespace hybrid_slam
