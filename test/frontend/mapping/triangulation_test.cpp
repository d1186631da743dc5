#include "frontend/mapping/triangulation.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <set>

#include "test/support/filled_map.h"

namespace hybrid_slam {
namespace {

// A map of which every second landmark of the scene was taken away: the keypoints that showed them
// are open.
struct HalfMap {
  explicit HalfMap(SyntheticSceneOptions options) {
    options.landmarks = 3000;
    scene = make_synthetic_scene(options);
    filled = fill_map(scene, {});
    MapEdit edit;
    for (std::size_t i = 1; i < filled.landmarks.size(); i += 2) {
      if (filled.landmarks[i].valid()) edit.erased_landmarks.push_back(filled.landmarks[i]);
    }
    filled.map.apply(edit);
  }

  // The scene's landmark behind an observation, -1 for clutter or a wrong match.
  int truth(const Observation& observation) const {
    const SyntheticFrame& frame = scene.frames[filled.frames[observation.keyframe.value]];
    return frame.outlier[observation.keypoint] ? -1 : frame.landmark[observation.keypoint];
  }

  std::set<int> open_in(KeyframeId id) const {
    std::set<int> open;
    const auto& landmarks = filled.map.view().at(id).landmarks;
    for (std::uint32_t i = 0; i < landmarks.size(); ++i) {
      if (!landmarks[i].valid() && truth({id, i}) >= 0) open.insert(truth({id, i}));
    }
    return open;
  }

  SyntheticScene scene;
  FilledMap filled;
};

SyntheticSceneOptions orbit(double noise) {
  SyntheticSceneOptions options;
  options.times = 30;
  options.noise = noise;
  options.clutter = 100;
  return options;
}

struct Score {
  int right = 0;
  int wrong = 0;
  std::vector<double> errors;  // of the right ones [m]

  double quantile(double share) {
    std::sort(errors.begin(), errors.end());
    return errors[static_cast<std::size_t>(share * static_cast<double>(errors.size() - 1))];
  }
};

Score score(const HalfMap& half, const MapEdit& edit) {
  Score result;
  for (const NewLandmark& landmark : edit.new_landmarks) {
    const int truth = half.truth(landmark.observations.front());
    const bool same =
        truth >= 0 && std::all_of(landmark.observations.begin(), landmark.observations.end(),
                                  [&](const Observation& o) { return half.truth(o) == truth; });
    ++(same ? result.right : result.wrong);
    if (same) {
      const auto& point = half.scene.points_in_world[static_cast<std::size_t>(truth)];
      result.errors.push_back((landmark.point_in_world - point).norm());
    }
  }
  return result;
}

// Open landmarks of a keyframe that one of its neighbours has open, too.
std::size_t possible(const HalfMap& half, KeyframeId keyframe) {
  const std::set<int> own = half.open_in(keyframe);
  std::set<int> shared;
  for (const Covisible& covisible : half.filled.map.view().covisible(keyframe, 1, 10)) {
    for (const int landmark : half.open_in(covisible.id)) {
      if (own.contains(landmark)) shared.insert(landmark);
    }
  }
  return shared.size();
}

TEST_CASE("Triangulation finds the landmarks two stereo keyframes have open") {
  HalfMap half(orbit(0.02));
  const KeyframeId keyframe = half.filled.keyframes[15];
  const MapEdit edit = triangulate_with_neighbours(half.filled.map.view(), keyframe, {});
  Score result = score(half, edit);
  REQUIRE(possible(half, keyframe) > 100);
  CHECK(result.right > 0.9 * static_cast<double>(possible(half, keyframe)));
  CHECK(result.wrong == 0);
  CHECK(result.quantile(0.5) < 0.005);  // the keypoints' noise is 0.05 to 0.15 px: millimetres
  CHECK(result.quantile(1) < 0.05);
  half.filled.map.apply(edit);
  CHECK(half.filled.map.check_consistency().empty());
}

TEST_CASE("Errors of triangulated points grow with the keypoints' noise") {
  HalfMap exact(orbit(0.02));
  HalfMap noisy(orbit(0.25));
  const auto median = [](HalfMap& half) {
    return score(half,
                 triangulate_with_neighbours(half.filled.map.view(), half.filled.keyframes[15], {}))
        .quantile(0.5);
  };
  CHECK(median(noisy) > 4 * median(exact));
  CHECK(median(noisy) < 0.05);
}

TEST_CASE("Wrong pairs make no landmarks") {
  SyntheticSceneOptions options = orbit(0.1);
  options.outlier_rate = 0.3;
  HalfMap half(options);
  Score all;
  for (const std::size_t k : {std::size_t{10}, std::size_t{20}}) {
    const Score one = score(
        half, triangulate_with_neighbours(half.filled.map.view(), half.filled.keyframes[k], {}));
    all.right += one.right;
    all.wrong += one.wrong;
  }
  CHECK(all.right > 100);
  CHECK(all.wrong < 0.02 * all.right);
}

TEST_CASE("Triangulation pairs a fisheye keyframe with stereo keyframes") {
  SyntheticSceneOptions options = orbit(0.05);
  options.fisheye = true;
  HalfMap half(options);
  const KeyframeId fisheye = half.filled.keyframes[31];
  const MapSnapshot& map = half.filled.map.view();
  MapEdit others;  // the neighbours with most in common would be fisheye keyframes, too
  for (const KeyframeId id : half.filled.keyframes) {
    if (id != fisheye && baseline(map.camera(map.at(id))) == 0)
      others.erased_keyframes.push_back(id);
  }
  half.filled.map.apply(others);
  REQUIRE(baseline(map.camera(map.at(fisheye))) == 0);
  const MapEdit edit = triangulate_with_neighbours(map, fisheye, {});
  Score result = score(half, edit);
  int mixed = 0;
  for (const NewLandmark& landmark : edit.new_landmarks) {
    const auto is_stereo = [&](const Observation& o) {
      return baseline(map.camera(map.at(o.keyframe))) > 0;
    };
    mixed += std::any_of(landmark.observations.begin(), landmark.observations.end(), is_stereo);
  }
  CHECK(mixed > 50);
  CHECK(result.right > 100);
  CHECK(result.wrong < 0.02 * result.right);
  CHECK(result.quantile(0.5) < 0.02);
}

TEST_CASE("Descriptors that look alike, or none at all, make no landmarks") {
  SyntheticSceneOptions options = orbit(0.02);
  options.descriptor_noise = 60;  // the landmark's own descriptor is as far away as any other
  HalfMap half(options);
  const MapEdit edit =
      triangulate_with_neighbours(half.filled.map.view(), half.filled.keyframes[15], {});
  CHECK(edit.new_landmarks.size() < 5);
}

TEST_CASE("Keyframes at the same place have no parallax to triangulate with") {
  SyntheticSceneOptions options = orbit(0.02);
  options.trajectory = SceneTrajectory::kHover;
  options.step = 1e-4;
  options.times = 2;
  HalfMap half(options);
  const MapEdit edit =
      triangulate_with_neighbours(half.filled.map.view(), half.filled.keyframes[1], {});
  CHECK(edit.new_landmarks.empty());
}

TEST_CASE("TriangulationOptions out of range are refused") {
  CHECK(TriangulationOptions().validate().empty());
  const auto refused = [](auto set) {
    for (const double value : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
      TriangulationOptions options;
      set(options, value);
      CHECK(!options.validate().empty());
    }
  };
  refused([](auto& options, double value) { options.min_baseline_ratio = value; });
  refused([](auto& options, double value) { options.max_parallax_cosine = value; });
  refused([](auto& options, double value) { options.ratio = value; });
  refused([](auto& options, double value) { options.epipolar_sigmas = value; });
  refused([](auto& options, double value) { options.max_scale_ratio = value; });
  refused([](auto& options, double value) { options.chi2_stereo = value; });
}

}  // namespace
}  // namespace hybrid_slam
