#include <catch2/catch.hpp>

#include <numbers>

#include "apps/scene_renderer/relief.h"
#include "apps/scene_renderer/sequence.h"

namespace hybrid_slam {
namespace {

double angle_between(const Rigid3d& a, const Rigid3d& b) {  // [rad]
  return a.rotation().angularDistance(b.rotation());
}

TEST_CASE("the vehicle hovers, the wrist sweeps within reach, off the ground, over common ground") {
  const SceneOptions options = make_scene_options(SceneKind::kHybrid, Difficulty::kNormal, 4);
  const SceneSequence sequence(options, make_scene_cameras(128, 96), 2);
  const auto& motion = sequence.motion();
  REQUIRE(motion.size() == 120);
  double swept = 0;
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const RigMoment& moment = motion[i];
    CHECK(moment.time == Approx(static_cast<double>(i) / 3));
    const Eigen::Vector3d vehicle =
        moment.world_from_left * Eigen::Vector3d(0.075, 0, 0);  // between the pair
    const Eigen::Vector3d wrist = moment.world_from_fish->translation();
    CHECK((wrist - vehicle).norm() > 0.3);
    CHECK((wrist - vehicle).norm() < 1.5);
    const auto ground = sequence.seafloor().cast(wrist.cast<float>(), -Eigen::Vector3f::UnitZ());
    REQUIRE(ground);
    CHECK(ground->distance > 0.29F);
    if (i % 6 == 0) CHECK(sequence.common_view(static_cast<int>(i)).in_view > 0.3);
    if (i == 0) continue;
    CHECK((moment.world_from_left.translation() - motion[i - 1].world_from_left.translation())
              .norm() < 0.04);
    CHECK((wrist - motion[i - 1].world_from_fish->translation()).norm() < 0.15);
    CHECK(angle_between(*moment.world_from_fish, *motion[i - 1].world_from_fish) < 0.25);
    swept = std::max(swept, (wrist - motion[0].world_from_fish->translation()).norm());
  }
  CHECK(swept > 0.5);
}

TEST_CASE("the hard preset turns the wrist away and back, and says when") {
  const SceneOptions options = make_scene_options(SceneKind::kHybrid, Difficulty::kHard, 4);
  const SceneSequence sequence(options, make_scene_cameras(128, 96), 2);
  int away = 0, silted = 0, episodes = 0;
  bool before = false;
  for (std::size_t i = 0; i < sequence.motion().size(); ++i) {
    const RigMoment& moment = sequence.motion()[i];
    away += moment.turned_away ? 1 : 0;
    silted += moment.silt > 0.99F ? 1 : 0;
    episodes += moment.turned_away && !before ? 1 : 0;
    before = moment.turned_away;
    const Eigen::Vector3d axis = moment.world_from_fish->rotation() * Eigen::Vector3d::UnitZ();
    if (moment.turned_away && sequence.motion()[i + 1].turned_away &&
        sequence.motion()[i - 1].turned_away) {
      CHECK(axis.z() > 0);  // up, into open water
    }
  }
  CHECK(episodes == 2);
  CHECK(away > 15);
  CHECK(away < 45);
  CHECK(silted >= 8);
}

TEST_CASE("a survey keeps its pace and height and comes back across its own path") {
  const SceneOptions options = make_scene_options(SceneKind::kSurvey, Difficulty::kNormal, 4);
  const RayCaster flat(make_icosphere(2, Material::kGround, 0), 1);
  const auto motion = make_motion(options, flat);
  REQUIRE(motion.size() == 400);
  std::size_t crossings = 0;
  for (std::size_t i = 1; i < motion.size(); ++i) {
    const Eigen::Vector3d place = motion[i].world_from_left.translation();
    const double step = (place - motion[i - 1].world_from_left.translation()).norm();
    CHECK(step < 0.13);
    CHECK(place.z() == Approx(1.5).margin(0.15));
    CHECK(angle_between(motion[i].world_from_left, motion[i - 1].world_from_left) < 0.35);
    const Eigen::Vector3d axis = motion[i].world_from_left.rotation() * Eigen::Vector3d::UnitZ();
    CHECK(axis.z() < -0.95);
    for (std::size_t k = 0; k + 60 < i; ++k) {
      if ((place - motion[k].world_from_left.translation()).norm() < 0.15) {
        ++crossings;
        break;
      }
    }
  }
  CHECK(crossings > 30);
}

TEST_CASE("a survey is as wide as asked for, and covers it evenly") {
  SceneOptions options = make_scene_options(SceneKind::kSurvey, Difficulty::kNormal, 1);
  options.frames = 700;
  options.width = 7;
  CHECK(survey_radius(options) == 3.5);
  const RayCaster flat(make_icosphere(2, Material::kGround, 0), 1);
  const auto motion = make_motion(options, flat);
  double left = 0, right = 0, longest = 0;
  for (std::size_t i = 1; i < motion.size(); ++i) {
    const Eigen::Vector3d place = motion[i].world_from_left.translation();
    left = std::min(left, place.x());
    right = std::max(right, place.x());
    longest = std::max(longest, (place - motion[i - 1].world_from_left.translation()).norm());
  }
  CHECK(right - left == Approx(7).margin(0.9));  // a turn is 0.88 m
  CHECK(longest < 0.13);
}

}  // namespace
}  // namespace hybrid_slam
