#include "frontend/matching/projection_matcher.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "test/support/frame_view.h"

namespace hybrid_slam {
namespace {

// Every second frame of an orbit is a keyframe; those between are what a camera sees next.
struct Scene {
  explicit Scene(bool fisheye = false) {
    SyntheticSceneOptions options;
    options.times = 30;
    options.clutter = 100;
    options.fisheye = fisheye;
    scene = make_synthetic_scene(options);
    FillOptions fill;
    fill.stride = 2;  // with a fisheye: the stereo frames
    filled = fill_map(scene, fill);
  }

  std::vector<ProjectionMatch> match(const FrameView& frame,
                                     const std::vector<char>* taken = nullptr,
                                     const ProjectionMatcherOptions& options = {}) const {
    const auto ids = filled.map.view().landmark_ids();
    const auto predictions = predict_landmarks(filled.map.view(), frame.camera(), frame.true_pose(),
                                               ids, options.max_view_angle_deg);
    return match_predictions(filled.map.view(), frame.view(), predictions, taken, options);
  }

  SyntheticScene scene;
  FilledMap filled;
};

struct Score {
  int right = 0;
  int wrong = 0;
  int possible = 0;  // keypoints that show a landmark of the map
};

Score score(const Scene& scene, const FrameView& frame,
            const std::vector<ProjectionMatch>& matches) {
  Score result;
  for (const ProjectionMatch& match : matches) {
    const LandmarkId truth = frame.truth(scene.filled, static_cast<std::size_t>(match.keypoint));
    ++(truth == match.landmark ? result.right : result.wrong);
  }
  for (std::size_t i = 0; i < frame.size(); ++i) {
    result.possible += frame.truth(scene.filled, i).valid() ? 1 : 0;
  }
  return result;
}

TEST_CASE("Landmarks are predicted where and as large as the camera sees them") {
  const Scene scene;
  const FrameView frame(scene.scene, 7);
  const MapSnapshot& map = scene.filled.map.view();
  const auto predictions =
      predict_landmarks(map, frame.camera(), frame.true_pose(), map.landmark_ids(), 60);
  REQUIRE(predictions.size() > 100);
  std::vector<double> scale_of(map.landmark_ids().back().value + 1, 0);
  for (std::size_t i = 0; i < frame.size(); ++i) {
    const LandmarkId id = frame.truth(scene.filled, i);
    if (id.valid()) scale_of[id.value] = frame.view().features.keypoints[i].scale;
  }
  int compared = 0;
  for (const LandmarkPrediction& prediction : predictions) {
    const auto expected =
        project_stereo(frame.camera(), frame.true_pose() * map.at(prediction.id).point_in_world);
    REQUIRE(expected);
    CHECK((prediction.pixel - expected->head<2>()).norm() < 1e-9);
    CHECK(prediction.u_right == Approx((*expected)[2]));
    if (scale_of[prediction.id.value] > 0) {
      CHECK(prediction.scale == Approx(scale_of[prediction.id.value]).epsilon(1e-5));
      ++compared;
    }
  }
  CHECK(compared > 100);
}

TEST_CASE("A camera that looks away is shown nothing; a stranger's angle is left out") {
  const Scene scene;
  const FrameView frame(scene.scene, 7);
  const MapSnapshot& map = scene.filled.map.view();
  const auto ids = map.landmark_ids();
  const Rigid3d turned(
      Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitY())),
      Eigen::Vector3d::Zero());
  CHECK(predict_landmarks(map, frame.camera(), turned * frame.true_pose(), ids, 60).empty());
  const auto all = predict_landmarks(map, frame.camera(), frame.true_pose(), ids, 60);
  const auto narrow = predict_landmarks(map, frame.camera(), frame.true_pose(), ids, 4);
  CHECK(!narrow.empty());
  CHECK(narrow.size() < all.size());
  for (const auto& prediction : narrow) {
    CHECK(prediction.view_cosine >= std::cos(4 * std::numbers::pi / 180));
  }
}

TEST_CASE("Projection matching finds the landmarks that are there") {
  const Scene scene;
  for (const std::size_t index : {std::size_t{1}, std::size_t{13}, std::size_t{25}}) {
    const FrameView frame(scene.scene, index);
    const auto matches = scene.match(frame);
    const Score result = score(scene, frame, matches);
    REQUIRE(result.possible > 100);
    CHECK(result.right > 0.95 * result.possible);
    CHECK(result.wrong == 0);
    for (std::size_t i = 1; i < matches.size(); ++i) {
      CHECK(matches[i - 1].keypoint < matches[i].keypoint);
    }
  }
}

TEST_CASE("A fisheye finds landmarks that only the stereo pair has seen") {
  const Scene scene(true);
  const FrameView frame(scene.scene, 21);
  REQUIRE(std::holds_alternative<Calibrated<KannalaBrandt>>(frame.camera()));
  ProjectionMatcherOptions options;
  options.max_view_angle_deg = 180;  // it sees the rim of its image at more than 60 degrees
  const Score result = score(scene, frame, scene.match(frame, nullptr, options));
  REQUIRE(result.possible > 100);
  CHECK(result.right > 0.9 * result.possible);
  CHECK(result.wrong == 0);
}

TEST_CASE("Keypoints of another scale are no match") {
  const Scene scene;
  FrameView frame(scene.scene, 7);
  const std::size_t before = scene.match(frame).size();
  const auto scale_by = [&](float factor) {
    for (Keypoint& keypoint : frame.features().keypoints) keypoint.scale *= factor;
    return scene.match(frame).size();
  };
  CHECK(scale_by(1.6F) == before);         // within 1.7
  CHECK(scale_by(1.8F / 1.6F) == 0);       // too coarse
  CHECK(scale_by(1 / 1.8F / 1.8F) == 0);   // too fine
  CHECK(scale_by(1.8F / 1.6F) == before);  // again within
}

TEST_CASE("A keypoint whose right coordinate disagrees is no match") {
  const Scene scene;
  FrameView frame(scene.scene, 7);
  std::size_t without_right = 0;
  for (float& u : frame.u_right()) u += 60;
  for (const ProjectionMatch& match : scene.match(frame)) {
    CHECK(std::isnan(frame.u_right()[static_cast<std::size_t>(match.keypoint)]));
    ++without_right;
  }
  CHECK(without_right > 0);
}

TEST_CASE("Taken keypoints are left alone") {
  const Scene scene;
  const FrameView frame(scene.scene, 7);
  std::vector<char> taken(frame.size(), 0);
  for (std::size_t i = 0; i < taken.size(); i += 2) taken[i] = 1;
  const auto matches = scene.match(frame, &taken);
  CHECK(matches.size() > 30);
  for (const auto& match : matches) CHECK(match.keypoint % 2 == 1);
}

TEST_CASE("ProjectionMatcherOptions out of range are refused") {
  CHECK(ProjectionMatcherOptions().validate().empty());
  const auto refused = [](auto set) {
    for (const double value : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
      ProjectionMatcherOptions options;
      set(options, value);
      CHECK(!options.validate().empty());
    }
  };
  refused([](auto& options, double value) { options.radius = value; });
  refused([](auto& options, double value) { options.ratio = value; });
  refused([](auto& options, double value) { options.max_scale_ratio = value; });
  refused([](auto& options, double value) { options.max_view_angle_deg = value; });
}

}  // namespace
}  // namespace hybrid_slam
