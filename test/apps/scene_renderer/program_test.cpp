#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/io/trajectory.h"
#include "apps/scene_renderer/rig_motion.h"
#include "cameras/calibration/calibration_file.h"
#include "frontend/input/image_sequence.h"
#include "test/support/child_process.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

Outcome render(const fs::path& folder, const std::vector<std::string>& arguments) {
  return run_program(SCENE_RENDERER, arguments, folder);
}

std::vector<std::string> small(const std::string& out, const std::vector<std::string>& more) {
  std::vector<std::string> arguments{out, "--quiet", "--resolution", "96x72", "--frames", "3"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

// Every file below a folder, with its content.
std::map<std::string, std::string> content_of(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files[fs::relative(entry.path(), folder).string()] = read_text(entry.path());
    }
  }
  return files;
}

void check_refused(const Outcome& outcome, int code, const std::string& reason) {
  INFO("stderr: " << outcome.err);
  CHECK(outcome.code == code);
  CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
  CHECK(outcome.err.find("scene_renderer: error: ") == 0);
  CHECK(outcome.err.find(reason) != std::string::npos);
}

TEST_CASE("the readers read a hybrid sequence, and the same options make the same bytes") {
  const TempFolder folder;
  REQUIRE(render(folder.path(), small("a", {"--threads", "1"})).code == 0);
  REQUIRE(render(folder.path(), small("b", {"--threads", "3"})).code == 0);
  const auto files = content_of(folder.path() / "a");
  CHECK(files.size() == 3 * 3 + 3 + 5);
  CHECK(files == content_of(folder.path() / "b"));

  const auto sequence =
      open_sequence((folder.path() / "a").string(), SequenceLayout::kAuto, "hybrid");
  const SequenceInfo& info = sequence->info();
  CHECK(info.layout == "uwslam");
  for (const std::string& warning : info.warnings) UNSCOPED_INFO(warning);
  CHECK(info.warnings.empty());
  CHECK(info.truth_convention == "world_from_cam");
  REQUIRE(info.truth.size() == 3);
  REQUIRE(sequence->size() == 3);
  CHECK(info.times[2] == Approx(2.0 / 3).margin(1e-6));
  CHECK(info.stereo.width == 96);
  CHECK(info.stereo.params[4] == Approx(0.15));
  CHECK(sequence->read(2).right.height == 72);
  const auto fisheye = read_fisheye((folder.path() / "a/hybrid/calibration/fisheye_calib.yaml"));
  CHECK(fisheye.width == 96);
  CHECK(fisheye.height == 96);
  const auto scene = nlohmann::json::parse(files.at("hybrid/hybrid/scene.json"));
  CHECK(scene["frames"] == 3);
  CHECK(scene["fisheye"]["common_view"].size() == 3);
}

TEST_CASE("the readers read a survey") {
  const TempFolder folder;
  REQUIRE(render(folder.path(), small("a", {"--kind", "survey", "--format", "png"})).code == 0);
  const auto sequence = open_sequence((folder.path() / "a").string(), SequenceLayout::kAuto, "");
  CHECK(sequence->info().name == "stereo");
  CHECK(sequence->info().warnings.empty());
  CHECK(sequence->info().truth.size() == 3);
  CHECK(sequence->info().times[2] == Approx(0.4).margin(1e-6));
  CHECK(sequence->read(0).left.width == 96);
}

TEST_CASE("another visit is told, and its truth is in the same world as the first one's") {
  const TempFolder folder;
  const std::vector<std::string> survey{"--kind", "survey", "--width", "2", "--seed", "7"};
  const auto with = [&](const std::string& out, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = small(out, survey);
    arguments.insert(arguments.end(), more.begin(), more.end());
    REQUIRE(render(folder.path(), arguments).code == 0);
  };
  with("plain", {});
  with("0", {"--visit", "0"});
  with("1", {"--visit", "1"});
  const auto first = content_of(folder.path() / "plain"), again = content_of(folder.path() / "1");
  CHECK((first == content_of(folder.path() / "0")));
  CHECK_FALSE(nlohmann::json::parse(first.at("stereo/scene.json")).contains("visit"));
  CHECK(nlohmann::json::parse(again.at("stereo/scene.json"))["visit"] == 1);
  for (const char* const image : {"stereo/images/0_0.jpg", "stereo/images/2_1.jpg"}) {
    CHECK((first.at(image) != again.at(image)));
  }
  for (const int visit : {0, 1}) {
    SceneOptions options = make_scene_options(SceneKind::kSurvey, Difficulty::kNormal, 7);
    options.visit = static_cast<std::uint32_t>(visit);
    options.frames = 3;
    options.width = 2;
    const RayCaster none(make_icosphere(0, Material::kGround, 0), 1);
    const auto motion = make_motion(options, none);
    const auto truth =
        read_trajectory(folder.path() / std::to_string(visit) / "stereo/gt_left_tum.txt").poses;
    REQUIRE(truth.size() == 3);
    for (std::size_t i = 0; i < 3; ++i) {
      const Rigid3d& pose = motion[i].world_from_left;
      const Eigen::Vector3d offset = truth[i].world_from_cam.translation() - pose.translation();
      CHECK((offset - Eigen::Vector3d(4, 7, -3)).norm() < 1e-6);
      CHECK(truth[i].world_from_cam.rotation().angularDistance(pose.rotation()) < 1e-6);
    }
  }
}

TEST_CASE("frames that are missing or doubled leave all others as they are, and are told") {
  const TempFolder folder;
  const auto with = [&](const std::string& out, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{
        out, "--quiet", "--kind", "survey",   "--frames", "12",           "--width",
        "2", "--seed",  "5",      "--format", "png",      "--resolution", "96x72"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    REQUIRE(render(folder.path(), arguments).code == 0);
    return content_of(folder.path() / out / "stereo");
  };
  const auto plain = with("plain", {}), zero = with("zero", {"--drop", "0", "--arm", "0"});
  CHECK((plain == zero));
  const auto holes = with("holes", {"--drop", "30", "--double", "30"});
  Conditions conditions;
  conditions.dropped = conditions.doubled = 30;
  const auto fates = frame_fates(conditions, 12, 5);
  REQUIRE(fates.size() < 12);
  const auto truth = read_trajectory(folder.path() / "holes/stereo/gt_left_tum.txt").poses;
  REQUIRE(truth.size() == fates.size());
  int doubled = 0;
  for (std::size_t i = 0; i < fates.size(); ++i) {
    const std::string picture = std::to_string(fates[i].picture);
    for (const char* const camera : {"_0.png", "_1.png"}) {
      CHECK((holes.at("images/" + std::to_string(i) + camera) ==
             plain.at("images/" + picture + camera)));
    }
    CHECK(truth[i].time == Approx(fates[i].moment / 5.0).margin(1e-6));
    doubled += fates[i].picture != fates[i].moment;
  }
  CHECK(doubled > 0);
  const auto scene = nlohmann::json::parse(holes.at("scene.json"));
  CHECK(scene["dropped_moments"].size() == 12 - fates.size());
  CHECK(scene["doubled_frames"].size() == static_cast<std::size_t>(doubled));
  CHECK(scene["conditions"]["dropped_percent"] == 30);
  CHECK_FALSE(nlohmann::json::parse(plain.at("scene.json")).contains("conditions"));
}

TEST_CASE("calibration files tell the nominal cameras, a file of its own the true ones") {
  const TempFolder folder;
  REQUIRE(render(folder.path(), small("plain", {})).code == 0);
  REQUIRE(
      render(folder.path(), small("wrong", {"--miscalibrate", "pitch=0.2,focal=-0.5,flat-port=20"}))
          .code == 0);
  const auto plain = content_of(folder.path() / "plain/hybrid");
  const auto wrong = content_of(folder.path() / "wrong/hybrid");
  for (const char* const file : {"left_camera.yaml", "right_camera.yaml", "fisheye_calib.yaml"}) {
    CHECK(plain.at(std::string("calibration/") + file) ==
          wrong.at(std::string("calibration/") + file));
  }
  CHECK((plain.at("hybrid/gt_left_tum.txt") == wrong.at("hybrid/gt_left_tum.txt")));
  CHECK((plain.at("hybrid/images/raw/1_left.jpg") != wrong.at("hybrid/images/raw/1_left.jpg")));
  CHECK((plain.at("hybrid/images/raw/1_fish.jpg") == wrong.at("hybrid/images/raw/1_fish.jpg")));
  CHECK(plain.count("hybrid/true_cameras.json") == 0);
  const auto truth = nlohmann::json::parse(wrong.at("hybrid/true_cameras.json"));
  CHECK(truth["left"]["fx"].get<double>() == Approx(0.995 * 858.35 * 96 / 1024));
  CHECK(truth["left_from_right_rotation"][2][1].get<double>() == Approx(std::sin(0.2 * 0.0174533)));
  CHECK(truth["flat_port"]["distance_m"].get<double>() == Approx(0.02));
}

TEST_CASE("masks of arm and dirt lie beside the images") {
  const TempFolder folder;
  REQUIRE(render(folder.path(), small("a", {"--preset", "arm", "--dirt", "20"})).code == 0);
  const auto files = content_of(folder.path() / "a/hybrid/hybrid");
  for (const char* const name : {"0_left", "0_right", "2_fish", "port_left", "port_fish"}) {
    CHECK(files.count("masks/" + std::string(name) + ".png") == 1);
  }
  const auto scene = nlohmann::json::parse(files.at("scene.json"));
  CHECK(scene["conditions"]["arm_percent"] == 30);
  CHECK(scene["left"]["arm_share"].size() == 3);
}

TEST_CASE("sequences share a folder if their cameras agree, and none is overwritten") {
  const TempFolder folder;
  const auto frame = [](const std::string& name, const std::string& size) {
    return std::vector<std::string>{"a",  "--quiet",    "--frames", "1", "--resolution",
                                    size, "--sequence", name};
  };
  REQUIRE(render(folder.path(), frame("one", "96x72")).code == 0);
  const auto before = content_of(folder.path() / "a");
  check_refused(render(folder.path(), frame("one", "96x72")), 3, "a/hybrid/one: is there already");
  check_refused(render(folder.path(), frame("two", "128x96")), 3,
                "left_camera.yaml: sequences beside this one have other cameras");
  CHECK(content_of(folder.path() / "a") == before);
  CHECK(render(folder.path(), frame("two", "96x72")).code == 0);
}

TEST_CASE("bad command lines and folders end in one line") {
  const TempFolder folder;
  write_text(folder.path() / "file", "x");
  const auto refused = [&](const std::vector<std::string>& arguments, int code,
                           const std::string& reason) {
    check_refused(render(folder.path(), arguments), code, reason);
  };
  refused({}, 2, "OUT is required");
  refused({""}, 2, "OUT");
  refused({"a", "--kind", "lunar"}, 2, "--kind");
  refused({"a", "--preset", "impossible"}, 2, "--preset");
  refused({"a", "--frames", "0"}, 2, "--frames");
  refused({"a", "--frames", "nan"}, 2, "--frames");
  refused({"a", "--kind", "survey", "--width", "nan"}, 2, "--width");
  refused({"a", "--width", "7"}, 2, "--width needs --kind survey");
  refused({"a", "--seed", "-1"}, 2, "--seed");
  refused({"a", "--visit", "-1"}, 2, "--visit");
  refused({"a", "--threads", "0"}, 2, "--threads");
  refused({"a", "--sequence", "../b"}, 2, "\"../b\" is no name of a sequence");
  refused({"a", "--unknown"}, 2, "--unknown");
  refused({"a", "--exposure-time", "nan"}, 2, "--exposure-time: is not between 0 and 10 S");
  refused({"a", "--photons", "-1"}, 2, "--photons: is not between");
  refused({"a", "--drop", "95"}, 2, "--drop: is not between");
  refused({"a", "--ground", "lava"}, 2, "--ground");
  for (const char* const spell : {"3", "3:", ":3", "3:0", "-1:3", "3:x", "nan:1", "3:1:2"}) {
    refused({"a", "--lamps-off", spell}, 2, "--lamps-off: \"" + std::string(spell) + "\" is no");
    refused({"a", "--silt", spell}, 2, "--silt: \"" + std::string(spell) + "\" is no");
  }
  for (const char* const error : {"pitch", "pitch=", "pitch=3", "tilt=1", "focal=nan", "=1"}) {
    refused({"a", "--miscalibrate", error}, 2, "--miscalibrate: \"" + std::string(error) + "\"");
  }
  for (const char* const size :
       {"640", "640x", "x480", "640x480x3", "0x480", "-640x480", "1e3x480", "640x99999999999"}) {
    refused({"a", "--resolution", size}, 2, "is no size like 1024x768");
  }
  refused({"file/a", "--quiet"}, 3, "cannot be made");
  CHECK_FALSE(fs::exists(folder.path() / "a"));
}

}  // namespace
}  // namespace hybrid_slam
