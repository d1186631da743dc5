#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "apps/scene_renderer/lamps.h"
#include "test/apps/scene_renderer/scene_matches.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector3d;

SceneOptions options_of(SceneKind kind, std::uint32_t visit, int frames) {
  SceneOptions options = make_scene_options(kind, Difficulty::kNormal, 5);
  options.visit = visit;
  options.frames = frames;
  if (kind == SceneKind::kSurvey) options.width = 3;
  return options;
}

// A survey of 3 m, made once per visit.
const SceneSequence& survey_of(std::uint32_t visit) {
  static std::map<std::uint32_t, std::unique_ptr<SceneSequence>> surveys;
  auto& survey = surveys[visit];
  if (!survey) {
    const int frames = 60 + static_cast<int>(visit);  // not what the seafloor depends on
    survey = std::make_unique<SceneSequence>(options_of(SceneKind::kSurvey, visit, frames),
                                             make_scene_cameras(448, 336), 2);
  }
  return *survey;
}

// Of the values of pixels.
std::vector<double> difference(const ColorImage& a, const ColorImage& b) {
  std::vector<double> result;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) result.push_back(a.pixels[i] - b.pixels[i]);
  return result;
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  double aa = 0, bb = 0, ab = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    aa += a[i] * a[i];
    bb += b[i] * b[i];
    ab += a[i] * b[i];
  }
  return ab / std::sqrt(aa * bb);
}

TEST_CASE("rays meet the same seafloor at every visit") {
  const RayCaster &first = survey_of(0).seafloor(), &second = survey_of(1).seafloor();
  Random random(1);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3f eye = random.vector(3, 2).cast<float>() + Eigen::Vector3f(0, 0, 4);
    const Eigen::Vector3f ray =
        Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), -1).normalized().cast<float>();
    const auto a = first.cast(eye, ray), b = second.cast(eye, ray);
    REQUIRE((a && b));
    CHECK(a->distance == b->distance);
    CHECK(a->triangle == b->triangle);
  }
  CHECK((first.mesh().materials == second.mesh().materials));  // not printed: a million
  CHECK((first.mesh().seeds == second.mesh().seeds));          // of the texture
}

TEST_CASE("the hybrid motion is another one at each visit") {
  const RayCaster flat(make_icosphere(2, Material::kGround, 0), 1);
  const auto motion_of = [&](std::uint32_t visit) {
    return make_motion(options_of(SceneKind::kHybrid, visit, 120), flat);
  };
  const auto first = motion_of(0), second = motion_of(1), third = motion_of(2);
  for (const auto& [a, b] : {std::pair{&first, &second}, {&first, &third}, {&second, &third}}) {
    double vehicle = 0, wrist = 0;  // mean distances
    for (std::size_t i = 0; i < a->size(); ++i) {
      const RigMoment &one = (*a)[i], &other = (*b)[i];
      CHECK(one.time == other.time);
      const double apart =
          (one.world_from_left.translation() - other.world_from_left.translation()).norm();
      CHECK(apart < 0.8);  // about the same place
      vehicle += apart / 120;
      wrist +=
          (one.world_from_fish->translation() - other.world_from_fish->translation()).norm() / 120;
    }
    CHECK(vehicle > 0.05);
    CHECK(wrist > 0.2);
  }
}

std::vector<RigMoment> motion_of_survey(std::uint32_t visit, int frames, double sway) {
  SceneOptions options = options_of(SceneKind::kSurvey, visit, frames);
  options.width = 7;
  options.sway = sway;
  return make_motion(options, RayCaster(make_icosphere(0, Material::kGround, 0), 1));
}

TEST_CASE("a survey's path is turned and shifted at another visit, and smaller") {
  const auto motion_of = [&](std::uint32_t visit) { return motion_of_survey(visit, 400, 0); };
  const auto between = [](const RigMoment& moment) {
    return moment.world_from_left * Vector3d(0.075, 0, 0);
  };
  const auto first = motion_of(0);
  for (const std::uint32_t visit : {1U, 2U, 3U, 77U}) {
    const auto again = motion_of(visit);
    // One motion in the plane takes the first visit's spiral to this one's.
    const Rigid3d moved = again[20].world_from_left * inverse(first[20].world_from_left);
    const Vector3d turn = Eigen::AngleAxisd(moved.rotation()).axis();
    CHECK(std::abs(turn.z()) == Approx(1));
    const double angle = Eigen::AngleAxisd(moved.rotation()).angle();
    CHECK((angle >= 0.2 && angle <= 0.7));
    const double shift = moved.translation().norm();
    CHECK((shift >= 0.2 && shift <= 0.4));
    CHECK(moved.translation().z() == Approx(0).margin(1e-9));
    for (const std::size_t i : {0U, 10U, 60U, 100U}) {
      CHECK((moved * between(first[i]) - between(again[i])).norm() < 1e-6);
    }
    double reach = 0;
    for (const RigMoment& moment : again) reach = std::max(reach, between(moment).head<2>().norm());
    CHECK(reach == Approx(0.75 * 3.5).margin(0.05));  // of the radius less the shift, shifted
  }
  double reach = 0;
  for (const RigMoment& moment : first) reach = std::max(reach, between(moment).head<2>().norm());
  CHECK(reach == Approx(3.5).margin(0.02));
}

TEST_CASE("another visit's survey sees ground that the first one saw") {
  const Camera camera = Calibrated<Pinhole>{{858, 858, 511.5, 383.5}, 1024, 768};
  const auto first = motion_of_survey(0, 400, 1);
  const auto sees = [&](const RigMoment& moment, const Vector3d& point) {
    const auto pixel = project(camera, inverse(moment.world_from_left) * point);
    return pixel && in_image(camera, *pixel);
  };
  for (const std::uint32_t visit : {1U, 2U, 3U}) {
    int points = 0, known = 0;
    for (const RigMoment& moment : motion_of_survey(visit, 120, 1)) {
      for (const double u : {0.0, 511.0, 1023.0}) {
        for (const double v : {0.0, 383.0, 767.0}) {
          const Vector3d eye = moment.world_from_left.translation();
          const Vector3d ray = moment.world_from_left.rotation() * *unproject(camera, {u, v});
          const Vector3d point = eye - eye.z() / ray.z() * ray;
          ++points;
          known += std::any_of(first.begin(), first.end(),
                               [&](const RigMoment& before) { return sees(before, point); })
                       ? 1
                       : 0;
        }
      }
    }
    INFO("visit " << visit << ": " << known << " of " << points);
    CHECK(known > 0.98 * points);
  }
}

TEST_CASE("another visit's lamps are mounted elsewhere, of other power and colour") {
  RigMoment at_origin, moved;
  at_origin.world_from_fish = Rigid3d();
  moved.world_from_left = {Eigen::Quaterniond(Eigen::AngleAxisd(1, Vector3d::UnitY())), {1, 2, 3}};
  const auto first = lamps_at(options_of(SceneKind::kHybrid, 0, 1), at_origin);
  REQUIRE(first.size() == 3);
  CHECK((first[0].position - Eigen::Vector3f(-0.38F, -0.2F, -0.05F)).norm() == 0);
  CHECK((first[1].position - Eigen::Vector3f(0.53F, -0.22F, -0.05F)).norm() == 0);
  CHECK(first[0].intensity[0] == Approx(3.2));
  for (const std::uint32_t visit : {1U, 2U, 3U}) {
    const SceneOptions options = options_of(SceneKind::kHybrid, visit, 1);
    const auto again = lamps_at(options, at_origin);
    REQUIRE(again.size() == 3);
    for (std::size_t i = 0; i < 3; ++i) {
      const float apart = (again[i].position - first[i].position).norm();
      CHECK(apart > 0.003F);
      CHECK(apart < (i < 2 ? 0.2F : 0.05F));
      const Color ratio = again[i].intensity / first[i].intensity;
      CHECK((ratio.minCoeff() > 0.65F && ratio.maxCoeff() < 1.4F));
      CHECK(std::abs(ratio[1] - 1) > 1e-4F);
      CHECK(std::abs(ratio[0] / ratio[2] - 1) > 1e-4F);
    }
    // They hang on the vehicle, and aim at the same place ahead of it.
    const auto hanging = lamps_at(options, moved);
    REQUIRE(hanging.size() == 2);
    for (std::size_t i = 0; i < 2; ++i) {
      const Vector3d place = moved.world_from_left * again[i].position.cast<double>();
      CHECK((hanging[i].position.cast<double>() - place).norm() < 1e-5);
      const Eigen::Vector3f way = Eigen::Vector3f(0.075F, 0, 1.9F) - again[i].position;
      CHECK(again[i].axis.dot(way.normalized()) == Approx(1).margin(1e-6));
    }
  }
}

TEST_CASE("each visit meets other snow and has noise of its own") {
  std::map<std::uint32_t, std::vector<double>> noise;
  for (const std::uint32_t visit : {0U, 1U}) {
    SceneOptions options = options_of(SceneKind::kSurvey, visit, 3);
    options.snow.largest_radius = 0.003F;
    const auto left_image = [&] {
      return SceneSequence(options, make_scene_cameras(192, 144), 2).render(2).left;
    };
    const ColorImage noisy = left_image();
    options.film.noise = 0;
    const SceneSequence quiet(options, make_scene_cameras(192, 144), 2);
    const ColorImage snowy = quiet.render(2).left;
    options.snow.density = 0;
    const auto snow = difference(snowy, left_image());
    noise[visit] = difference(noisy, snowy);

    // What the first visit's snow would look like from here.
    const RigMoment& rig = quiet.motion()[2];
    const ViewRays rays = make_view_rays(left_camera(quiet), kPinholeHalfAngle, 2);
    SceneMoment moment;
    moment.lighting.lamps = lamps_at(options, rig);
    RadianceImage image{rays.width, rays.height, {}, {}, {}};
    image.pixels.assign(rays.bearing.size(), Color::Zero());
    image.distance.assign(rays.bearing.size(), 1.3F);  // the ground hides what is beyond
    draw_snow(quiet.options().snow, moment, left_camera(quiet), rays, rig.world_from_left, rig.time,
              options.seed, image);
    std::vector<double> expected;
    for (const Color& color : image.pixels) {
      for (const int channel : {2, 1, 0}) expected.push_back(std::min(color[channel], 0.2F));
    }
    INFO("visit " << visit << ": " << correlation(snow, expected));
    CHECK((visit == 0) == (correlation(snow, expected) > 0.5));
    CHECK((visit == 1) == (std::abs(correlation(snow, expected)) < 0.1));
  }
  CHECK(std::abs(correlation(noise[0], noise[1])) < 0.03);
}

TEST_CASE("features of one visit lie in the other's images where depth and poses put them") {
  const SceneSequence &first = survey_of(0), &second = survey_of(1);
  const int from = 10;
  const Rigid3d& pose = first.motion()[from].world_from_left;
  int to = 0;
  double nearest = 1e9;
  for (int i = 0; i < 60; ++i) {
    const Rigid3d& other = second.motion()[static_cast<std::size_t>(i)].world_from_left;
    const double apart = (other.translation() - pose.translation()).norm();
    if (apart < nearest) to = i;
    nearest = std::min(nearest, apart);
  }
  CHECK(nearest < 0.5);
  const FeatureSet now = sift_of(first.render(from).left, 1200);
  const FeatureSet later = sift_of(second.render(to).left, 1200);
  const auto matches = match_sift(now, later, 0.8);
  REQUIRE(matches.size() > 80);
  const TruthErrors errors =
      compare_with_truth(matches, first.seafloor(), left_camera(first), pose, left_camera(second),
                         second.motion()[static_cast<std::size_t>(to)].world_from_left);
  CHECK(errors.gross < matches.size() / 5);
  CHECK(errors.median() < 0.6);
  CHECK(errors.median_offset().norm() < 0.2);
}

}  // namespace
}  // namespace hybrid_slam
