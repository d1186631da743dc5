#include <catch2/catch.hpp>

#include <map>

#include "test/apps/scene_renderer/scene_matches.h"

namespace hybrid_slam {
namespace {

constexpr int kWidth = 448, kHeight = 336, kFeatures = 1200;

const SceneSequence& sequence_of(Difficulty difficulty) {
  static std::map<Difficulty, std::unique_ptr<SceneSequence>> sequences;
  auto& sequence = sequences[difficulty];
  if (!sequence) {
    sequence =
        std::make_unique<SceneSequence>(make_scene_options(SceneKind::kHybrid, difficulty, 3),
                                        make_scene_cameras(kWidth, kHeight), 2);
  }
  return *sequence;
}

// Mean absolute difference of neighbouring grey values in the middle of the image.
double contrast(const ColorImage& image) {
  const GrayImage grey = gray(image);
  double sum = 0;
  int count = 0;
  for (int y = grey.height / 4; y < 3 * grey.height / 4; y += 2) {
    for (int x = grey.width / 4; x < 3 * grey.width / 4; x += 2, ++count) {
      sum += std::abs(grey.row(y)[x] - grey.row(y)[x + 4]);
    }
  }
  return sum / count;
}

TEST_CASE("matched features of a rendered pair lie on the same row, at the truth's disparity") {
  const SceneSequence& sequence = sequence_of(Difficulty::kNormal);
  const RenderedFrame frame = sequence.render(10);
  const FeatureSet left = sift_of(frame.left, kFeatures), right = sift_of(frame.right, kFeatures);
  REQUIRE(left.size() > 1000);
  const auto matches = match_sift(left, right, 0.8);
  REQUIRE(matches.size() > 300);
  std::vector<double> rows, signed_rows;
  for (const PixelMatch& match : matches) {
    rows.push_back(std::abs(match.to.y() - match.from.y()));
    signed_rows.push_back(match.to.y() - match.from.y());
  }
  CHECK(median(rows) < 0.3);
  CHECK(std::abs(median(signed_rows)) < 0.03);

  const Rigid3d& left_pose = sequence.motion()[10].world_from_left;
  const double baseline = sequence.cameras().stereo.params[4];
  const Rigid3d right_pose(left_pose.rotation(), left_pose * Eigen::Vector3d(baseline, 0, 0));
  const TruthErrors errors = compare_with_truth(matches, sequence.seafloor(), left_camera(sequence),
                                                left_pose, left_camera(sequence), right_pose);
  CHECK(errors.gross < matches.size() / 10);
  CHECK(errors.median() < 0.4);
  CHECK(errors.median_offset().norm() < 0.06);
}

TEST_CASE("features of one frame lie in the next where depth and poses put them") {
  const SceneSequence& sequence = sequence_of(Difficulty::kNormal);
  const FeatureSet now = sift_of(sequence.render(10).left, kFeatures);
  const FeatureSet next = sift_of(sequence.render(12).left, kFeatures);
  const auto matches = match_sift(now, next, 0.8);
  REQUIRE(matches.size() > 250);
  const TruthErrors errors = compare_with_truth(
      matches, sequence.seafloor(), left_camera(sequence), sequence.motion()[10].world_from_left,
      left_camera(sequence), sequence.motion()[12].world_from_left);
  CHECK(errors.gross < matches.size() / 10);
  CHECK(errors.median() < 0.5);
  CHECK(errors.median_offset().norm() < 0.1);
}

TEST_CASE("features of the left image lie in the fisheye image where depth and poses put them") {
  const SceneSequence& sequence = sequence_of(Difficulty::kEasy);
  std::size_t count = 0, gross = 0;
  TruthErrors all;
  for (const int index : {10, 40}) {
    const RenderedFrame frame = sequence.render(index);
    const FeatureSet left = sift_of(frame.left, kFeatures),
                     fish = sift_of(*frame.fish, 2 * kFeatures);
    const auto matches = match_sift(left, fish, 0.75);
    const RigMoment& rig = sequence.motion()[static_cast<std::size_t>(index)];
    const TruthErrors errors =
        compare_with_truth(matches, sequence.seafloor(), left_camera(sequence), rig.world_from_left,
                           sequence.cameras().fisheye, *rig.world_from_fish);
    count += matches.size();
    gross += errors.gross;
    all.errors.insert(all.errors.end(), errors.errors.begin(), errors.errors.end());
  }
  CHECK(count > 40);
  CHECK(all.errors.size() > 30);
  CHECK(all.median() < 0.8);
  CHECK(all.median_offset().norm() < 0.25);
}

TEST_CASE("a frame does not depend on the number of threads or on frames before, but on the seed") {
  const auto make = [](std::uint32_t seed, int threads) {
    SceneOptions options = make_scene_options(SceneKind::kHybrid, Difficulty::kHard, seed);
    options.frames = 20;
    return std::make_unique<SceneSequence>(options, make_scene_cameras(128, 96), threads);
  };
  const auto one = make(1, 1), three = make(1, 3), other = make(2, 3);
  const RenderedFrame a = one->render(12);
  three->render(3);
  const RenderedFrame b = three->render(12), c = other->render(12);
  CHECK(a.left.pixels == b.left.pixels);
  CHECK(a.right.pixels == b.right.pixels);
  CHECK(a.fish->pixels == b.fish->pixels);
  CHECK(a.left.pixels != c.left.pixels);
  CHECK(a.left.pixels != a.right.pixels);
}

TEST_CASE("harder presets show less, and their silt blinds the fisheye") {
  const SceneSequence& hard = sequence_of(Difficulty::kHard);
  std::map<Difficulty, std::size_t> matches;
  std::map<Difficulty, double> contrasts;
  for (const Difficulty preset : {Difficulty::kEasy, Difficulty::kNormal, Difficulty::kHard}) {
    const RenderedFrame frame = sequence_of(preset).render(2);
    contrasts[preset] = contrast(frame.left);
    matches[preset] =
        match_sift(sift_of(frame.left, kFeatures), sift_of(frame.right, kFeatures), 0.8).size();
  }
  CHECK(contrasts[Difficulty::kEasy] > 1.15 * contrasts[Difficulty::kNormal]);
  CHECK(contrasts[Difficulty::kNormal] > 1.15 * contrasts[Difficulty::kHard]);
  CHECK(matches[Difficulty::kEasy] > matches[Difficulty::kNormal]);
  CHECK(matches[Difficulty::kNormal] > matches[Difficulty::kHard]);
  CHECK(matches[Difficulty::kHard] > 100);

  int blind = 0, clear = 0;
  for (std::size_t i = 0; i < hard.motion().size(); ++i) {
    if (hard.motion()[i].silt == 1) blind = static_cast<int>(i);
    if (hard.motion()[i].silt == 0 && !hard.motion()[i].turned_away) clear = static_cast<int>(i);
  }
  REQUIRE(blind > 0);
  CHECK(hard.common_view(blind).visible < 0.05);
  CHECK(hard.common_view(clear).visible > 0.95);
  CHECK(contrast(*hard.render(blind).fish) < 0.6 * contrast(*hard.render(clear).fish));
}

}  // namespace
}  // namespace hybrid_slam
