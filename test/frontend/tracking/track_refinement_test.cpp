#include "frontend/tracking/track_refinement.h"

#include <catch2/catch.hpp>
#include <random>

#include "backend/map/map.h"
#include "test/frontend/matching/blob_texture.h"

namespace hybrid_slam {
namespace {

constexpr int kWidth = 240;
constexpr int kHeight = 180;
constexpr double kFocal = 200;
constexpr double kDepth = 2;              // of a textured wall, parallel to the image
const Eigen::Vector2d kShift(5.3, -2.6);  // of the second image against the first [px]
constexpr double kShading = 10;           // depth per size where lamps move; strong, to be seen

Calibrated<RectifiedStereo> camera() {
  return {{kFocal, kFocal, 119.5, 89.5, 0.1}, kWidth, kHeight};
}

Frame wall_frame(std::int64_t index, const Eigen::Vector2d& shift, const BlobTexture& texture,
                 std::mt19937_64& random) {
  StereoFeatures features;
  features.left.kind = DescriptorKind::kSynthetic;
  for (int y = 30; y <= kHeight - 30; y += 20) {
    for (int x = 30; x <= kWidth - 30; x += 20) {
      Keypoint keypoint;
      keypoint.x = static_cast<float>(x + shift.x());
      keypoint.y = static_cast<float>(y + shift.y());
      keypoint.scale = 2;
      features.left.keypoints.push_back(keypoint);
      features.left.descriptors.emplace_back();
      features.u_right.push_back(keypoint.x - 10);  // 0.1 m * 200 px / 2 m
    }
  }
  Frame frame = make_frame(index, 0.1 * static_cast<double>(index), features, kWidth, kHeight);
  const Eigen::Vector2d offset = -shift;
  frame.image = std::make_shared<const ImagePyramid>(
      texture.render(kWidth, kHeight, Eigen::Matrix2d::Identity(), offset, 1, 0, 1, random));
  frame.cam_from_world = Rigid3d(Eigen::Quaterniond::Identity(),
                                 {shift.x() * kDepth / kFocal, shift.y() * kDepth / kFocal, 0});
  return frame;
}

// The same wall as lamps make it seem to have moved. Keypoints grow to the right, in such a way
// that the share of the motion that is missing is a straight line: the image is stretched.
Frame shaded(Frame frame, const BlobTexture& texture, std::mt19937_64& random) {
  const auto lag = [](double x) { return 0.02 + 0.0004 * x; };
  for (Keypoint& keypoint : frame.features.left.keypoints) {
    keypoint.scale = static_cast<float>(
        kFocal * 1e-3 * std::pow(lag(keypoint.x - kShift.x()) / kShading / 1e-3, 4 / 3.));
  }
  const double stretch = 1 / (1 - kShift.x() * 0.0004);
  Eigen::Matrix2d first_from_second = Eigen::Matrix2d::Identity();
  first_from_second(0, 0) = stretch;
  const Eigen::Vector2d offset(-stretch * kShift.x() * 0.98, -kShift.y());
  frame.image = std::make_shared<const ImagePyramid>(
      texture.render(kWidth, kHeight, first_from_second, offset, 1, 0, 1, random));
  return frame;
}

// A wall seen by a keyframe (frame 0) and by a frame whose keypoints are off by half a pixel.
struct Wall {
  explicit Wall(bool moving_lamps = false) {
    std::mt19937_64 random(3);
    const BlobTexture texture(kWidth, kHeight, random);
    first = wall_frame(0, Eigen::Vector2d::Zero(), texture, random);
    second = wall_frame(1, kShift, texture, random);
    if (moving_lamps) {
      second = shaded(second, texture, random);
      for (std::size_t i = 0; i < first.size(); ++i) {
        first.features.left.keypoints[i].scale = second.features.left.keypoints[i].scale;
      }
    }
    camera_id = map.add_camera(camera());
    auto observations = std::make_shared<FrameObservations>();
    observations->camera = camera_id;
    observations->features = first.features.left;
    observations->u_right = first.features.u_right;
    NewKeyframe keyframe{observations, Rigid3d(), {}, {}, {}};
    for (std::uint32_t i = 0; i < first.size(); ++i) {
      const Keypoint& k = first.features.left.keypoints[i];
      keyframe.new_points.emplace_back(
          i, *triangulate_stereo(camera(), {k.x, k.y, first.features.u_right[i]}));
    }
    second.landmarks = map.view().at(map.add_keyframe(keyframe)).landmarks;
    true_positions = second.features.left.keypoints;
    for (std::size_t i = 0; i < second.size(); ++i) {
      const float error = i % 2 == 0 ? 0.5F : -0.4F;
      second.features.left.keypoints[i].x += error;
      second.features.left.keypoints[i].y -= error;
      second.features.u_right[i] += error;
    }
  }

  Map map;
  CameraId camera_id;
  Frame first = make_frame(0, 0, {}, 1, 1);
  Frame second = first;
  std::vector<Keypoint> true_positions;
};

// Error of both coordinates after the refinement [px]; it was 0.64.
double refined_error(const TrackRefinementOptions& options) {
  Wall wall;
  TrackRefiner refiner(wall.camera_id, camera(), options);
  refiner.remember(wall.first);
  const auto before = wall.second.features;
  const int refined = refiner.refine(wall.map.view(), wall.second);
  CHECK(refined > 0.9 * static_cast<double>(wall.second.size()));
  double squares = 0;
  int moved = 0;
  for (std::size_t i = 0; i < wall.second.size(); ++i) {
    const Keypoint& now = wall.second.features.left.keypoints[i];
    const Keypoint& was = before.left.keypoints[i];
    CHECK(now.x - wall.second.features.u_right[i] ==
          Approx(was.x - before.u_right[i]).margin(1e-4));
    if (now.x == was.x) continue;
    ++moved;
    squares += std::pow(now.x - wall.true_positions[i].x, 2) +
               std::pow(now.y - wall.true_positions[i].y, 2);
    CHECK(now.sigma == Approx(2 * TrackRefinementOptions().sigma));  // scale 2
  }
  CHECK(moved == refined);
  return std::sqrt(squares / moved);
}

TEST_CASE("Matched keypoints move to where their landmark's first view looks the same") {
  TrackRefinementOptions options;
  CHECK(refined_error(options) <
        std::sqrt(2.0) * 0.5 * 2 * options.sigma);  // half of what is promised
  options.alignment.half_size = 7;  // more texture, and more shading where lamps move
  CHECK(refined_error(options) < 0.05);
}

TEST_CASE("Patches that are kept from the frame before change no position") {
  Wall wall;
  TrackRefiner fresh(wall.camera_id, camera(), {});
  TrackRefiner used(wall.camera_id, camera(), {});
  fresh.remember(wall.first);
  used.remember(wall.first);
  Frame before = wall.second;  // shows every third landmark
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (i % 3 != 0) before.landmarks[i] = LandmarkId();
  }
  CHECK(used.refine(wall.map.view(), before) > 10);
  Frame expected = wall.second;
  CHECK(fresh.refine(wall.map.view(), expected) == used.refine(wall.map.view(), wall.second));
  CHECK(expected.aligned == wall.second.aligned);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    CHECK(expected.features.left.keypoints[i].x == wall.second.features.left.keypoints[i].x);
    CHECK(expected.features.left.keypoints[i].y == wall.second.features.left.keypoints[i].y);
  }
}

// A frame of another place, with a single track: it tells nothing, but what comes then is news.
Frame elsewhere(Frame frame) {
  frame.cam_from_world = Rigid3d(Eigen::Quaterniond::Identity(), {kDepth, 0, 0});
  frame.aligned.resize(1);
  return frame;
}

TEST_CASE("What moving lamps pretend is learnt from frames apart and taken out") {
  const Wall wall(true);
  TrackRefinementOptions options;
  options.shading.prior_sigma = 100;
  options.keyframes = 100;
  options.alignment.half_size = 7;
  TrackRefiner refiner(wall.camera_id, camera(), options);
  refiner.remember(wall.first);
  const auto error = [&](Frame frame) {  // along the motion, mean [px]
    refiner.refine(wall.map.view(), frame);
    double sum = 0;
    for (const std::size_t i : frame.aligned) {
      sum += frame.features.left.keypoints[i].x - wall.true_positions[i].x;
    }
    CHECK(frame.aligned.size() > 55);
    return sum / static_cast<double>(frame.aligned.size());
  };
  CHECK(error(wall.second) == Approx(-5.3 * (0.02 + 0.0004 * 120)).margin(0.02));
  CHECK(refiner.shading() == 0);
  const auto learn = [&] {
    Frame frame = wall.second;
    refiner.refine(wall.map.view(), frame);
    refiner.learn_shading(wall.map.view(), frame);
    return frame;
  };
  CHECK(refiner.shading_doubt().of_vehicle == 0);
  learn();
  CHECK(refiner.shading_doubt().of_vehicle > 0);
  const double once = refiner.shading();
  for (int i = 0; i < 30; ++i) learn();
  CHECK(refiner.shading() == once);  // it hovers: one frame, thirty times
  for (int i = 0; i < 30; ++i) refiner.learn_shading(wall.map.view(), elsewhere(learn()));
  CHECK(refiner.shading() == Approx(kShading).epsilon(0.15));
  CHECK(error(wall.second) == Approx(0).margin(0.06));
  Frame features_only = wall.second;
  features_only.image.reset();
  refiner.refine(wall.map.view(), features_only);
  refiner.learn_shading(wall.map.view(), features_only);
  CHECK(refiner.shading_doubt().of_vehicle == 0);
}

TEST_CASE("Without the image of a first view nothing moves") {
  Wall wall;
  const auto unchanged = [&](TrackRefiner refiner) {
    const std::vector<Keypoint> before = wall.second.features.left.keypoints;
    CHECK(refiner.refine(wall.map.view(), wall.second) == 0);
    for (std::size_t i = 0; i < before.size(); ++i) {
      CHECK(before[i].x == wall.second.features.left.keypoints[i].x);
    }
  };
  unchanged(TrackRefiner(wall.camera_id, camera(), {}));

  TrackRefinementOptions one;
  one.keyframes = 1;  // a later keyframe's image displaces the first one's
  TrackRefiner forgetful(wall.camera_id, camera(), one);
  forgetful.remember(wall.first);
  forgetful.remember(wall.second);
  unchanged(forgetful);

  TrackRefinementOptions off;
  off.enabled = false;
  TrackRefiner disabled(wall.camera_id, camera(), off);
  disabled.remember(wall.first);
  unchanged(disabled);
}

TEST_CASE(
    "Images of keyframes that were culled are let go, of those to come and of the others not") {
  Wall wall;
  TrackRefiner refiner(wall.camera_id, camera(), {});
  std::vector<std::weak_ptr<const ImagePyramid>> images;
  for (const std::int64_t index : {0, 1, 2}) {
    Frame frame = wall.first;
    frame.index = index;
    frame.image = std::make_shared<const ImagePyramid>(*wall.first.image);
    images.push_back(frame.image);
    refiner.remember(frame);
  }
  const auto kept = [&] {
    refiner.forget_culled(wall.map.view());
    std::vector<bool> alive;
    for (const auto& image : images) alive.push_back(!image.expired());
    return alive;
  };
  CHECK(kept() == std::vector<bool>{true, true, true});  // 1 and 2 are not in the map yet
  auto observations = std::make_shared<FrameObservations>(
      *wall.map.view().at(wall.map.view().origin()).observations);
  observations->frame_index = 1;
  const KeyframeId second =
      wall.map.add_keyframe({observations, Rigid3d(), wall.second.landmarks, {}, {}});
  CHECK(kept() == std::vector<bool>{true, true, true});
  MapEdit culled;
  culled.erased_keyframes = {second};
  wall.map.apply(culled);
  CHECK(kept() == std::vector<bool>{true, false, true});
}

}  // namespace
}  // namespace hybrid_slam
