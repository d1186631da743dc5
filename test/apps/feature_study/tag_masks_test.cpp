#include <cmath>

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "apps/feature_eval/study/study_sequence.h"
#include "cameras/files/input_error.h"
#include "test/apps/rendered_survey.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

TEST_CASE("a tag's circle is the cone around its corners, white border included") {
  const Camera camera = survey_camera();  // focal length 260 px, principal point (159.5, 119.5)
  const PixelBearings bearings(camera);
  // Half the diagonal of 10/8 of 0.2 m, 2 m ahead: asin(0.17678 / 2) = 5.071 degrees, 23.07 px.
  const GrayImage mask =
      bearings.without_tags({{7, 0.2, {1, 0, 2}}}, Rigid3d({1, 0, 0, 0}, {1, 0, 0}), std::nullopt);
  const auto at = [&](double x, double y) {
    return mask.row(static_cast<int>(y))[static_cast<int>(x)];
  };
  for (const double side : {-1.0, 1.0}) {
    CHECK(at(159.5 + side * 22.5, 119.5) == 0);
    CHECK(at(159.5 + side * 24, 119.5) == 255);
    CHECK(at(159.5, 119.5 + side * 22.5) == 0);
    CHECK(at(159.5, 119.5 + side * 24) == 255);
  }
  const Rigid3d turned_away(Eigen::Quaterniond(0, 0, 1, 0), {1, 0, 0});
  for (const std::uint8_t pixel :
       bearings.without_tags({{7, 0.2, {1, 0, 2}}}, turned_away, std::nullopt).pixels) {
    REQUIRE(pixel == 255);
  }
}

TEST_CASE("a tag beside a fisheye is masked where its rays are, and what was black stays so") {
  const Camera camera = survey_fisheye();
  const PixelBearings bearings(camera);
  GrayImage black{360, 360, std::vector<std::uint8_t>(360 * 360, 255)};
  black.pixels[5] = 0;
  const Eigen::Vector3d tag(1, 1, -0.1);  // 94 degrees from the axis
  const GrayImage mask = bearings.without_tags({{1, 0.3, tag}}, {}, black);
  const auto pixel = project(camera, tag);
  REQUIRE(pixel);
  const auto at = [&](double x, double y) {
    return mask.row(static_cast<int>(std::lround(y)))[static_cast<int>(std::lround(x))];
  };
  REQUIRE(in_image(camera, *pixel));
  CHECK(at(pixel->x(), pixel->y()) == 0);
  CHECK(at(pixel->x() - 14, pixel->y() - 14) ==
        0);  // its circle has a radius of 10.8 degrees, 22 px
  CHECK(at(pixel->x() - 28, pixel->y() - 28) == 255);
  CHECK(mask.pixels[5] == 0);
}

TEST_CASE("tags are read with and without how they are turned") {
  const TempFolder folder;
  const auto path = folder.path() / "tags.txt";
  write_text(path, "# id size x y z\n3 0.16 1 2 3\n4 0.2 -1 0 0.5 1 0 0 0\n");
  const std::vector<Tag> tags = read_tags(path);
  REQUIRE(tags.size() == 2);
  CHECK(tags[0].id == 3);
  CHECK(tags[0].size == 0.16);
  CHECK(tags[1].centre_in_world == Eigen::Vector3d(-1, 0, 0.5));
  write_text(path, "3 0.16 1 2 3\n4 0.2 -1\n");
  CHECK_THROWS_WITH(read_tags(path), Catch::Contains("tags.txt:2: expected 5 or 9 numbers"));
  write_text(path, "3 0 1 2 3\n");
  CHECK_THROWS_AS(read_tags(path), InputError);
}

TEST_CASE("a study's pairs are every so many frames with truth, masked where asked") {
  const TempFolder folder;
  const auto data = folder.path() / "data";
  write_uwslam_survey(data, false);
  const auto sequence = data / "hybrid/M1";
  const StudySequence plain(sequence.string(), 3, false);
  CHECK(plain.frames() == std::vector<std::size_t>{0, 3, 6});
  const StudyPair pair = plain.read(3);
  CHECK_FALSE(pair.left_mask);
  const Rigid3d truth = inverse(survey_pose(3)) * survey_fisheye_pose(3);
  CHECK((pair.left_from_fisheye.translation() - truth.translation()).norm() < 1e-9);
  CHECK(pair.left_from_fisheye.rotation().angularDistance(truth.rotation()) < 1e-9);
  CHECK(StudySequence(sequence.string(), 3, true).warnings().size() == 1);  // nothing to mask

  const Eigen::Vector3d ahead =
      open_sequence(sequence.string(), SequenceLayout::kAuto, "")->info().truth[3].world_from_cam *
      Eigen::Vector3d(0, 0, 1);
  write_text(sequence / "tags.txt",
             fmt::format("0 0.1 {} {} {}\n", ahead.x(), ahead.y(), ahead.z()));
  const StudyPair masked = StudySequence(sequence.string(), 3, true).read(3);
  REQUIRE(masked.left_mask);
  REQUIRE(masked.fisheye_mask);
  CHECK(masked.left_mask->row(119)[159] == 0);
  CHECK(masked.left_mask->row(119)[200] == 255);
  const auto in_fisheye =
      project(Camera(survey_fisheye()), inverse(truth) * Eigen::Vector3d(0, 0, 1));
  REQUIRE(in_fisheye);
  CHECK(masked.fisheye_mask->row(
            static_cast<int>(in_fisheye->y()))[static_cast<int>(in_fisheye->x())] == 0);
}

}  // namespace
}  // namespace hybrid_slam
