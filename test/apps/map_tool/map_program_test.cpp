// map_tool as its user sees it.
#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>

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

}  // namespace

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
