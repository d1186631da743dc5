// hybrid_slam with a map of an earlier run.
#include <algorithm>

#include <catch2/catch.hpp>
#include <opencv2/imgcodecs.hpp>

#include "apps/io/trajectory.h"
#include "backend/map/map_file.h"
#include "test/apps/program_run.h"
#include "test/apps/rendered_survey.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

// The survey, and the map of a run over it in out/map.hslam.
struct Mapped {
  Mapped() {
    write_kitti_survey(folder.path() / "data");
    const Outcome outcome = run({"--out", "out"});
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
  }

  Outcome run(const std::vector<std::string>& more) const {
    return run_slam(folder.path(), "data", more);
  }

  TempFolder folder;
  fs::path map = folder.path() / "out/map.hslam";
};

TEST_CASE("hybrid_slam goes on with a saved map") {
  const Mapped mapped;
  const Outcome outcome = mapped.run({"--map", "out/map.hslam", "--out", "again"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  const auto summary = read_json(mapped.folder.path() / "again/summary.json");
  CHECK(summary["frames"]["tracked"] == kSurveyFrames);
  CHECK(summary["poses_from"]["relocalization"] == 1);
  CHECK(summary["options"]["map"] == "out/map.hslam");
  CHECK(summary["loops"]["rejected"].is_object());
  const LoadedMap before = load_map(mapped.map);
  const LoadedMap after = load_map(mapped.folder.path() / "again/map.hslam");
  CHECK(after.map.view().origin() == before.map.view().origin());
  CHECK(after.map.view().camera_count() == 1);
  CHECK(after.map.view().keyframe_count() >= before.map.view().keyframe_count());
  // In the frame of the first run.
  const auto first = read_trajectory(mapped.folder.path() / "out/stereo.tum").poses;
  const auto second = read_trajectory(mapped.folder.path() / "again/stereo.tum").poses;
  REQUIRE(first.size() == second.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    CHECK((first[i].world_from_cam.translation() - second[i].world_from_cam.translation()).norm() <
          0.005);
  }
}

// The right images stand `rows` px higher: a camera that is turned about its horizontal axis.
void raise_right_images(const fs::path& data, int rows) {
  for (int frame = 0; frame < kSurveyFrames; ++frame) {
    const std::string path = kitti_image(data, true, frame).string();
    const cv::Mat image = cv::imread(path, cv::IMREAD_GRAYSCALE);
    cv::Mat raised = image.clone();
    image.rowRange(rows, image.rows).copyTo(raised.rowRange(0, image.rows - rows));
    REQUIRE(cv::imwrite(path, raised));
  }
}

TEST_CASE("the pair of the first run is where the second one begins") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "right");
  write_kitti_survey(folder.path() / "wrong");
  raise_right_images(folder.path() / "wrong", 2);
  const auto calibration = [&](const std::string& data, const std::vector<std::string>& more) {
    const Outcome outcome = run_slam(folder.path(), data, more);
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    auto found = read_json(folder.path() / more.back() / "summary.json")["calibration"];
    CHECK(count_lines(outcome.err, "not as the map says") ==
          static_cast<int>(found["changes"].size()));
    return found;
  };
  const auto first = calibration("wrong", {"--out", "first"});
  REQUIRE(first["taken_out"].is_object());
  // By other pairs it would be found a little otherwise.
  const auto second =
      calibration("wrong", {"--map", "first/map.hslam", "--start", "4", "--out", "second"});
  CHECK(second["taken_out"] == first["taken_out"]);
  CHECK(second["changes"].empty());
  const auto alone = calibration("wrong", {"--start", "4", "--out", "alone"});
  CHECK(alone["taken_out"] != first["taken_out"]);
  const auto repaired = calibration("right", {"--map", "first/map.hslam", "--out", "repaired"});
  CHECK(repaired["taken_out"].is_null());
  REQUIRE(repaired["changes"].size() == 1);
  CHECK_THAT(repaired["changes"][0].get<std::string>(),
             Catch::StartsWith("rows are off by nothing"));
  const auto map = load_map(folder.path() / "repaired/map.hslam").map;
  CHECK_FALSE(map.view().correction(CameraId(0)).rows);
}

TEST_CASE("hybrid_slam finds itself in a map and leaves it alone") {
  const Mapped mapped;
  const std::string before = read_text(mapped.map);
  const Outcome outcome =
      mapped.run({"--map", "out/map.hslam", "--localize", "--out", "out"});  // beside the map
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(read_text(mapped.map) == before);
  const auto summary = read_json(mapped.folder.path() / "out/summary.json");
  CHECK(summary["frames"]["tracked"] == kSurveyFrames);
  CHECK(summary["keyframes"] == load_map(mapped.map).map.view().keyframe_count());
  CHECK(summary["ate"]["position_m"]["rmse"] < 0.003);
  CHECK(mapped.run({"--map", "out/map.hslam", "--localize", "--out", "elsewhere"}).code == 0);
  CHECK(!fs::exists(mapped.folder.path() / "elsewhere/map.hslam"));
}

TEST_CASE("Maps that cannot be gone on with are refused in one line") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  const auto run = [&](const std::vector<std::string>& more) {
    return run_slam(folder.path(), "data", more);
  };
  check_refused(run({"--map", "none.hslam"}), 3, "none.hslam");
  write_text(folder.path() / "text.hslam", "not a map at all\n");
  check_refused(run({"--map", "text.hslam"}), 3, "text.hslam");
  Map empty;
  save_map(folder.path() / "empty.hslam", *empty.snapshot(), {});
  check_refused(run({"--map", "empty.hslam"}), 3, "empty.hslam: the map holds no keyframe");
  auto observations = std::make_shared<FrameObservations>();
  observations->features.kind = DescriptorKind::kRootSiftOpenCv;
  empty.add_camera(survey_camera());
  observations->camera = CameraId(0);
  empty.add_keyframe({observations, Rigid3d(), {}, {}, KeyframeId()});
  save_map(folder.path() / "other.hslam", *empty.snapshot(), {});
  check_refused(run({"--map", "other.hslam"}), 3, "other.hslam: the map's descriptors are");
  check_refused(run({"--localize"}), 2, "--localize needs --map");
  check_refused(run({"--loops", "perhaps"}), 2, "--loops");
}

}  // namespace
}  // namespace hybrid_slam
