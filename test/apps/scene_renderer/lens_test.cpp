#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>

#include "cameras/geometry/so3.h"
#include "test/apps/scene_renderer/scene_matches.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
const Calibrated<Pinhole> kPinhole{{858, 858, 507, 390}, 1024, 768};

TEST_CASE("a wrong lens projects a point to the pixel whose ray meets it") {
  Miscalibration errors;
  errors.focal = 0.5;
  errors.distortion = -0.4;
  errors.flat_port = 30;
  const Lens lens(kPinhole, errors);
  for (const Vector2d& pixel : {Vector2d(0, 0), Vector2d(1023, 40), Vector2d(507, 390),
                                Vector2d(300, 700), Vector2d(900, 390)}) {
    const auto ray = lens.unproject(pixel);
    REQUIRE(ray);
    for (const double distance : {0.4, 1.0, 3.0}) {
      const Vector3d point = ray->shift * Vector3d::UnitZ() + distance * ray->bearing;
      const auto back = lens.project(point);
      REQUIRE(back);
      CHECK((*back - pixel).norm() < 1e-6);
    }
  }
}

TEST_CASE("focal length and distortion are off by their percentages") {
  const Vector2d middle(507, 390);
  const double radius = std::hypot(516, 390);  // of the corner (1023, 0)
  const auto at = [&](const Miscalibration& errors, double off) {
    const Vector3d point(off / 858, 0, 1);
    return Lens(kPinhole, errors).project(2 * point)->x() - middle.x();
  };
  Miscalibration focal, distortion;
  focal.focal = 0.5;
  distortion.distortion = 0.3;
  CHECK(at(focal, 400) == Approx(402).epsilon(1e-9));
  CHECK(at(distortion, radius) == Approx(1.003 * radius).epsilon(1e-9));
  CHECK(at(distortion, radius / 2) == Approx((1 + 0.003 / 4) * radius / 2).epsilon(1e-9));
  CHECK(at({}, 400) == Approx(400).epsilon(1e-12));
}

TEST_CASE("rays through a flat port obey Snell's law, and the pinhole is right at one metre") {
  constexpr double kPort = 0.02;  // [m]
  Miscalibration errors;
  errors.flat_port = 1000 * kPort;
  const Lens lens(kPinhole, errors);
  double largest = 0;
  for (const double in_air : {0.05, 0.3, 0.6, 0.75, 0.9}) {
    const double in_water = std::asin(std::sin(in_air) / kWaterIndex);
    // The camera's origin is where rays near the axis seem to come from: the index times the
    // port's distance behind the port.
    const auto from_axis = [&](double z) {
      return kPort * std::tan(in_air) + (z - kWaterIndex * kPort) * std::tan(in_water);
    };
    const double expected = 507 + 858 * from_axis(1);
    for (const double z : {0.4, 1.0, 1.9, 4.0}) {
      const auto pixel = lens.project({from_axis(z), 0, z});
      REQUIRE(pixel);
      CHECK(pixel->x() == Approx(expected).margin(1e-6));
      CHECK(pixel->y() == Approx(390).margin(1e-9));
      const double pinhole = 507 + 858 * from_axis(z) / z;
      if (z == 1.9) largest = std::max(largest, std::abs(pinhole - expected));
    }
  }
  CHECK(largest > 0.5);  // [px] what a calibration at one metre does wrong at twice the distance
  CHECK(largest < 3);
}

SceneSequence sequence_with(const Miscalibration& errors, double right_late_ms, double shake = 0) {
  SceneOptions options = make_scene_options(SceneKind::kHybrid, Difficulty::kEasy, 3, 20);
  options.conditions.miscalibration = errors;
  options.conditions.right_late = right_late_ms;
  options.conditions.shake = shake;
  return SceneSequence(options, make_scene_cameras(448, 336), 2);
}

TEST_CASE("a right camera turned by 0.2 degrees sees features on other rows, by the geometry") {
  Miscalibration errors;
  errors.pitch = 0.2;
  errors.yaw = 0.1;
  errors.roll = -0.1;
  const SceneSequence sequence = sequence_with(errors, 0);
  const RenderedFrame frame = sequence.render(4);
  const auto matches = match_sift(sift_of(frame.left, 1200), sift_of(frame.right, 1200), 0.8);
  REQUIRE(matches.size() > 300);
  std::vector<double> rows;
  for (const PixelMatch& match : matches) rows.push_back(match.to.y() - match.from.y());
  const double focal = sequence.cameras().stereo.params[0];
  CHECK(median(rows) == Approx(focal * std::tan(0.2 * kDegree)).margin(0.2));  // 1.3 px

  const Rigid3d& left = sequence.motion()[4].world_from_left;
  const Vector3d turn = kDegree * Vector3d(0.2, 0.1, -0.1);
  const Rigid3d right(left.rotation() * so3_exp(turn), left * Vector3d(0.15, 0, 0));
  const TruthErrors truth = compare_with_truth(matches, sequence.seafloor(), left_camera(sequence),
                                               left, left_camera(sequence), right);
  CHECK(truth.median() < 0.4);
  CHECK(truth.median_offset().norm() < 0.06);
}

TEST_CASE("a right image out of step shows what its camera sees at that time") {
  const SceneSequence sequence = sequence_with({}, 60, 1);
  const RenderedFrame frame = sequence.render(4);
  const auto matches = match_sift(sift_of(frame.left, 1200), sift_of(frame.right, 1200), 0.8);
  REQUIRE(matches.size() > 300);
  const RigMotion motion(sequence.options(), sequence.seafloor());
  const Rigid3d& left = sequence.motion()[4].world_from_left;
  const auto offset_for = [&](double late) {
    const Rigid3d then = motion.at(sequence.motion()[4].time + late).world_from_left;
    const Rigid3d right(then.rotation(), then * Vector3d(0.15, 0, 0));
    return compare_with_truth(matches, sequence.seafloor(), left_camera(sequence), left,
                              left_camera(sequence), right)
        .median_offset()
        .norm();
  };
  CHECK(offset_for(0.06) < 0.06);
  CHECK(offset_for(0) > 0.5);
}

TEST_CASE("images show features where the true lens, not the calibration, puts them") {
  Miscalibration errors;
  errors.focal = 0.5;
  errors.distortion = 0.5;
  errors.flat_port = 30;
  const SceneSequence wrong = sequence_with(errors, 0), right = sequence_with({}, 0);
  const auto matches =
      match_sift(sift_of(right.render(4).left, 1200), sift_of(wrong.render(4).left, 1200), 0.8);
  REQUIRE(matches.size() > 300);
  const Rigid3d& pose = right.motion()[4].world_from_left;
  std::vector<double> apart, by_lens, by_lens_x, by_lens_y;
  for (const PixelMatch& match : matches) {
    const Vector3d bearing = *unproject(left_camera(right), match.from);
    const auto hit = right.seafloor().cast(pose.translation().cast<float>(),
                                           (pose.rotation() * bearing).cast<float>());
    if (!hit || (match.to - match.from).norm() > 12) continue;
    const auto place = wrong.stereo_lens().project(hit->distance * bearing);
    REQUIRE(place);
    apart.push_back((match.to - match.from).norm());
    by_lens.push_back((match.to - *place).norm());
    by_lens_x.push_back(match.to.x() - place->x());
    by_lens_y.push_back(match.to.y() - place->y());
  }
  CHECK(median(apart) > 0.7);
  CHECK(median(by_lens) < 0.25);
  CHECK(std::abs(median(by_lens_x)) < 0.06);
  CHECK(std::abs(median(by_lens_y)) < 0.06);
}

}  // namespace
}  // namespace hybrid_slam
