// map_tool as its user sees it.
#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>

#include "backend/map/map_assembly.h"
#include "backend/map/map_file.h"
#include "backend/map/section_file.h"
#include "test/apps/map_tool/tool_maps.h"
#include "test/support/child_process.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

// A map file, and a program that runs beside it.
struct Bench {
  TempFolder folder;
  std::string bytes;

  Bench() {
    FilledMap filled = map_of_frames(make_synthetic_scene(small_orbit(12, true)), 0, 24, 1);
    save_map(folder.path() / "map.hslam", filled.map.view(), {"a program", ""});
    bytes = read_text(folder.path() / "map.hslam");
  }
  ~Bench() { CHECK(read_text(folder.path() / "map.hslam") == bytes); }

  Outcome run(const std::vector<std::string>& arguments) const {
    return run_program(MAP_TOOL, arguments, folder.path());
  }
};

// What was found out about the pair of a dive.
RigCorrection found_rig(double offset) {
  RigCorrection found;
  found.rows = PairAlignment{3e-3, -2e-3, 5e-3, 412, 1.6, 0.3, 1e-5, 2e-5, 3e-5};
  found.disparity = FoundParameter{offset, 0.03, 0.04, offset};
  return found;
}

}  // namespace

TEST_CASE("map_tool: what was found out about the cameras is told and kept") {
  const Bench bench;
  const auto path = [&](const char* name) { return bench.folder.path() / name; };
  // Two dives, of which the first file holds the later one.
  FilledMap later = map_of_frames(make_synthetic_scene(small_orbit(12, true)), 12, 24, 1);
  FilledMap earlier = map_of_frames(make_synthetic_scene(small_orbit(12, true)), 0, 12, 1);
  later.map.set_correction(CameraId(0), found_rig(1.25));
  earlier.map.set_correction(CameraId(0), found_rig(-0.5));
  save_map(path("later.hslam"), later.map.view(), {"a program", ""});
  save_map(path("earlier.hslam"), earlier.map.view(), {"a program", ""});

  const Outcome info = bench.run({"info", "later.hslam", "--json", "info.json"});
  CHECK_THAT(info.out, Catch::Contains("right camera turned by 0.172 +- 0.001 deg about x"));
  CHECK_THAT(info.out, Catch::Contains("disparities [px] 1.250 +- 0.050, 1.250 in use"));
  const auto json = nlohmann::json::parse(read_text(path("info.json")))["cameras"];
  CHECK(json[0]["found"]["disparity_offset_px"]["value"] == 1.25);
  CHECK(json[0]["found"]["rows"]["matches"] == 412);
  CHECK(json[0]["found"]["shading_depth"].is_null());
  CHECK(json[1]["found"]["rows"].is_null());

  CHECK(bench.run({"crop", "later.hslam", "--from", "0.7", "--out", "part.hslam"}).code == 0);
  CHECK(load_map(path("part.hslam")).map.view().correction(CameraId(0)) == found_rig(1.25));
  const std::vector<MapPart> parts{{&later.map.view(), later.map.view().keyframe_ids(), {}},
                                   {&earlier.map.view(), earlier.map.view().keyframe_ids(), {}}};
  CHECK(assemble_map(parts).view().correction(CameraId(0)) == found_rig(1.25));
  const Outcome out = bench.run({"export", "later.hslam", "--format", "tum", "--out", "poses"});
  CHECK_THAT(out.out, Catch::Contains("camera 0, not in the export: offset of the disparities"));
}

TEST_CASE("map_tool: info, verify, crop, export in turn") {
  const Bench bench;
  const Outcome info = bench.run({"info", "map.hslam", "--json", "info.json"});
  CHECK(info.code == 0);
  CHECK(info.out.find("keyframes   24") != std::string::npos);
  CHECK(nlohmann::json::parse(read_text(bench.folder.path() / "info.json"))["keyframes"] == 24);

  CHECK(bench.run({"verify", "map.hslam"}).out == "map.hslam: sound\n");

  CHECK(bench.run({"crop", "map.hslam", "--from", "0.2", "--to", "0.5", "--out", "part.hslam"})
            .code == 0);
  CHECK(load_map(bench.folder.path() / "part.hslam").map.view().keyframe_count() == 8);
  CHECK(bench.run({"crop", "map.hslam", "--box=-1,-1,-9,9,9,9", "--out", "box.hslam"}).code == 0);
  CHECK(bench.run({"verify", "box.hslam"}).code == 0);

  CHECK(bench.run({"export", "map.hslam", "--format", "tum", "--out", "poses"}).code == 0);
  CHECK(std::filesystem::exists(bench.folder.path() / "poses/fisheye.tum"));
}

TEST_CASE("map_tool: what cannot be done is refused in one line, and changes nothing") {
  const Bench bench;
  const auto refused = [&](const std::vector<std::string>& arguments, int code,
                           const std::string& reason) {
    const Outcome outcome = bench.run(arguments);
    CAPTURE(outcome.err);
    CHECK(outcome.code == code);
    CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
    CHECK(outcome.err.find(reason) != std::string::npos);
  };
  refused({}, 2, "subcommand");
  refused({"crop", "map.hslam", "--out", "x"}, 2, "is needed");
  refused({"crop", "map.hslam", "--box", "1,2,3", "--out", "x"}, 2, "--box");
  refused({"export", "map.hslam", "--format", "obj", "--out", "x"}, 2, "--format");
  refused({"merge", "map.hslam", "--out", "x"}, 2, "MAP");
  refused({"info", "none.hslam"}, 3, "none.hslam");
  refused({"crop", "map.hslam", "--from", "9e9", "--out", "x"}, 3, "nothing would be left");
  refused({"crop", "map.hslam", "--component", "7", "--out", "x"}, 3, "there are 0");
  refused({"crop", "map.hslam", "--from", "0", "--out", "./map.hslam"}, 3, "never changed");
  refused({"merge", "map.hslam", "map.hslam", "--out", "x"}, 3, "another kind");
  refused({"export", "map.hslam", "--format", "colmap", "--out", "x", "--images", "."}, 3,
          "no sequence");
  CHECK(!std::filesystem::exists(bench.folder.path() / "x"));
}

TEST_CASE("map_tool verify: exit codes of what is damaged and of what is wrong") {
  const Bench bench;
  std::string cut = bench.bytes.substr(0, bench.bytes.size() / 2);
  write_text(bench.folder.path() / "cut.hslam", cut);
  CHECK(bench.run({"verify", "cut.hslam"}).code == 3);

  FilledMap filled = map_of_frames(make_synthetic_scene(small_orbit(12, true)), 0, 24, 1);
  Rigid3d pose = filled.map.view().at(KeyframeId(6)).cam_from_world;
  pose.translation().x() += 0.1;
  filled.map.move({{KeyframeId(6), pose}}, {});
  save_map(bench.folder.path() / "moved.hslam", filled.map.view(), {});
  const Outcome moved = bench.run({"verify", "moved.hslam"});
  CHECK(moved.code == 4);
  CHECK(moved.out.find("keyframe 6: ") != std::string::npos);

  // Inconsistent, which load_map() refuses: a landmark whose direction is stale.
  MapTables tables = tables_of(filled.map);
  tables.landmarks.edit(0).mean_direction = Eigen::Vector3d(1, 0, 0);
  const Map stale = MapFileAccess::make(std::move(tables));
  save_map(bench.folder.path() / "stale.hslam", stale.view(), {});
  const Outcome wrong = bench.run({"verify", "stale.hslam"});
  CHECK(wrong.code == 4);
  CHECK(wrong.out.find("landmark 0: stale direction") != std::string::npos);
  CHECK(bench.run({"info", "stale.hslam"}).code == 3);
}

}  // namespace hybrid_slam
