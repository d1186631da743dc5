#include <fmt/format.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include <catch2/catch.hpp>

#include "apps/report/coverage.h"
#include "apps/report/frame_data.h"
#include "apps/report/jpeg_encoder.h"
#include "apps/report/map_figures.h"
#include "apps/report/report.h"
#include "apps/report/report_data.h"
#include "apps/report/run_story.h"
#include "apps/report/verdict.h"
#include "backend/map/map_file.h"
#include "frontend/input/image_file.h"
#include "frontend/input/text_file.h"
#include "test/support/filled_map.h"
#include "test/support/temp_folder.h"
#include "test/support/test_cameras.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

void write(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path) << text;
}

FilledMap hybrid_map(double noise) {
  SyntheticSceneOptions options;
  options.fisheye = true;
  options.times = 12;
  options.noise = noise;
  return fill_map(make_synthetic_scene(options), {});
}

// A keyframe at the origin that looks along z and sees these points with both eyes.
void add_view(Map& map, CameraId camera, const std::vector<Eigen::Vector3d>& points, float sigma) {
  auto seen = std::make_shared<FrameObservations>();
  seen->camera = camera;
  seen->frame_index = map.view().newest_frame_index(camera) + 1;
  seen->time = 0.5 * static_cast<double>(seen->frame_index);
  seen->features.kind = DescriptorKind::kSynthetic;
  NewKeyframe keyframe;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d at = *project_stereo(map.view().camera(camera), point);
    const auto index = static_cast<std::uint32_t>(seen->features.size());
    seen->features.keypoints.push_back(
        {static_cast<float>(at.x()), static_cast<float>(at.y()), 2, 0, 10, sigma});
    seen->features.descriptors.push_back({});
    seen->u_right.push_back(static_cast<float>(at.z()));
    keyframe.new_points.emplace_back(index, point);
  }
  keyframe.landmarks.resize(points.size());
  keyframe.observations = seen;
  map.add_keyframe(keyframe);
}

// 4 m by 3 m in front of the camera, every 5 cm.
std::vector<Eigen::Vector3d> flat_ground(double depth) {
  std::vector<Eigen::Vector3d> points;
  for (int i = -40; i <= 40; ++i) {
    for (int j = -30; j <= 30; ++j) points.emplace_back(0.05 * i, 0.05 * j, depth);
  }
  return points;
}

constexpr const char* kFrames =
    "camera,time,index,state,source,prediction,causes,tx,ty,tz,qx,qy,qz,qw,sigma_position,features,"
    "stereo_matches,inliers\n"
    "stereo,10.0,0,map,initialization,none,,0,0,0,0,0,0,1,0,900,500,0\n"
    "stereo,10.5,1,map,local_map,odometer,,0.5,0,0,0,0,0,1,0.002,900,500,300\n"
    "stereo,11.0,2,lost,lost,odometer,dark=13,,,,,,,,,40,3,0\n"
    "stereo,11.5,3,lost,lost,none,dark=12;few_features=0.02,,,,,,,,,30,2,0\n"
    "stereo,12.0,,dropped,,,\n"
    "stereo,12.5,4,relocalised,relocalization,none,,2,0,0,0,0,0,1,0.004,900,500,200\n";

Json data_of(const std::filesystem::path& page) {
  const std::string text = read_text_file(page);
  const std::string begin = R"(<script id="data" type="application/json">)";
  const std::size_t from = text.find(begin) + begin.size();
  return Json::parse(text.substr(from, text.find("</script>", from) - from));
}

}  // namespace

TEST_CASE("residuals are those of the noise that was put in", "[report]") {
  const FilledMap exact = hybrid_map(0);
  const MapFigures none = map_figures(exact.map.view());
  REQUIRE(none.cameras.size() == 2);
  CHECK(none.cameras[0].stereo);
  CHECK_FALSE(none.cameras[1].stereo);
  for (const CameraResiduals& camera : none.cameras) {
    CHECK(camera.observations > 1000);
    CHECK(camera.rms_px == Approx(0.05).epsilon(0.03));  // the scene's least noise
    CHECK(camera.rms_sigmas == Approx(1).epsilon(0.03));
  }

  const FilledMap noisy = hybrid_map(0.25);
  const MapFigures figures = map_figures(noisy.map.view());
  for (const CameraResiduals& camera : figures.cameras) {
    INFO((camera.stereo ? "stereo" : "fisheye"));
    CHECK(camera.behind == 0);
    CHECK(camera.rms_px > 0.2);
    CHECK(camera.rms_sigmas == Approx(1).epsilon(0.03));  // points and poses are the true ones
    std::size_t in_cells = 0;
    double squares = 0;
    for (const ResidualCell& cell : camera.cells) {
      in_cells += cell.count;
      squares += cell.rms * cell.rms * static_cast<double>(cell.count);
    }
    CHECK(in_cells == camera.observations);
    CHECK(std::sqrt(squares / static_cast<double>(in_cells)) == Approx(camera.rms_px));
  }
}

TEST_CASE("a landmark's sigma is that of one look with both eyes", "[report]") {
  Map map;
  const auto calibrated = TestCamera<RectifiedStereo>::camera();
  const CameraId camera = map.add_camera(calibrated);
  const double depth = 3, sigma = 0.5;
  const Eigen::Vector3d on_axis(0, 0, depth);
  add_view(map, camera, {on_axis}, static_cast<float>(sigma));
  const MapFigures figures = map_figures(map.view());
  REQUIRE(figures.landmarks.size() == 1);
  // d u / d x = a in both images and d v / d y = a; d u_right / d z = c.
  const double a = calibrated.params[0] / depth;
  const double c = calibrated.params[0] * calibrated.params[4] / (depth * depth);
  CHECK(figures.landmarks[0].sigma ==
        Approx(sigma * std::sqrt(2 / (a * a) + 2 / (c * c))).epsilon(1e-6));
  CHECK(figures.landmarks[0].views == 1);
  CHECK(figures.keyframes[0].distance == Approx(depth));
  CHECK(figures.keyframes[0].resolution == Approx(1e3 * depth / calibrated.params[0]));
}

TEST_CASE("the ground that one keyframe sees is measured, and a second one seen as overlap",
          "[report]") {
  Map map;
  const CameraId camera = map.add_camera(TestCamera<RectifiedStereo>::camera());
  add_view(map, camera, flat_ground(5), 0.5F);
  const MapFigures once = map_figures(map.view());
  const Coverage coverage = find_coverage(once);
  CHECK(std::abs(coverage.axes(2, 2)) == Approx(1).margin(1e-6));
  CHECK(coverage.axes(2, 2) < 0);  // the normal points back to the camera
  const Json seen = to_json(coverage, once);
  // 4 m by 3 m; the farthest 5 %, its corners, are left out.
  CHECK(seen["area_m2"].get<double>() > 0.9 * 12);
  CHECK(seen["area_m2"].get<double>() < 12);
  CHECK(seen["seen_once_share"] == 1.0);
  CHECK(seen["fisheye_area_m2"] == 0.0);
  CHECK(seen["resolution_mm_per_px"].get<double>() == Approx(5e3 / 868.4).epsilon(1e-4));

  add_view(map, camera, flat_ground(5), 0.5F);
  const MapFigures twice = map_figures(map.view());
  CHECK(to_json(find_coverage(twice), twice)["seen_once_share"].get<double>() < 0.05);
}

TEST_CASE("the ground is measured to its ends, and not beyond for one far landmark", "[report]") {
  Map map;
  const CameraId camera = map.add_camera(TestCamera<RectifiedStereo>::camera());
  std::vector<Eigen::Vector3d> points = flat_ground(5);
  const MapFigures flat = [&] {
    add_view(map, camera, points, 0.5F);
    return map_figures(map.view());
  }();
  const Coverage coverage = find_coverage(flat);
  CHECK(coverage.columns * coverage.cell == Approx(4).margin(0.1));
  CHECK(coverage.rows * coverage.cell == Approx(3).margin(0.1));

  Map farther;
  farther.add_camera(TestCamera<RectifiedStereo>::camera());
  points.emplace_back(0, 0, 500);
  add_view(farther, camera, points, 0.5F);
  const Coverage same = find_coverage(map_figures(farther.view()));
  CHECK(same.columns == coverage.columns);
  CHECK(same.rows == coverage.rows);
}

TEST_CASE("a map without landmarks has no ground", "[report]") {
  CHECK(find_coverage(MapFigures()).empty());
  CHECK(to_json(Coverage(), MapFigures()).is_null());
}

TEST_CASE("losses are told with their causes; what was left out is none", "[report]") {
  const TempFolder folder;
  write(folder.path() / "frames.csv", kFrames);
  const RunStory story = read_story(folder.path(), nullptr);
  REQUIRE(story.frames.size() == 6);
  CHECK(story.span == Approx(2.5));
  CHECK(story.period == Approx(0.5));
  REQUIRE(story.losses.size() == 1);
  CHECK(story.losses[0].frames == 2);
  CHECK(story.frames[story.losses[0].first].time == 11.0);
  CHECK(story.frames[story.losses[0].last].time == 11.5);
  REQUIRE(story.losses[0].before);
  CHECK(story.frames[*story.losses[0].before].time == 10.5);
  CHECK(story.losses[0].cause == "dark, few_features");  // of half of the frames at least
  CHECK(story.frames[1].world_from_cam->translation().x() == 0.5);
  CHECK(std::isnan(story.frames[4].features));
}

TEST_CASE("a frame that began a component lies where the map has it in the end", "[report]") {
  const TempFolder folder;
  const FilledMap filled = hybrid_map(0);
  const MapSnapshot& map = filled.map.view();
  const Keyframe* const keyframe = map.newest_keyframe(CameraId(0));
  REQUIRE(keyframe != nullptr);
  write(folder.path() / "frames.csv",
        fmt::format("camera,time,index,state,tx,ty,tz,qx,qy,qz,qw,reference,features\n"
                    "{},1,{},starting,70,80,90,0,0,0,1,,500\n",
                    baseline(map.camera(CameraId(0))) > 0 ? "stereo" : "fisheye",
                    keyframe->observations->frame_index));
  const auto pose = read_story(folder.path(), &map).frames.at(0).world_from_cam;
  REQUIRE(pose);
  const Rigid3d expected = inverse(keyframe->cam_from_world);
  CHECK((pose->translation() - expected.translation()).norm() < 1e-12);
  CHECK(read_story(folder.path(), nullptr).frames.at(0).world_from_cam->translation().x() == 70);
}

TEST_CASE("what happened is summed up: losses, times, errors by state", "[report]") {
  const TempFolder folder;
  write(folder.path() / "frames.csv", kFrames);
  write(folder.path() / "timing.csv",
        "time,cpu_ms,behind_ms\n10.0,100,10\n10.5,200,30\n11.0,300,20\n11.5,200,\n12.5,200,90\n");
  write(folder.path() / "errors.csv",
        "camera,time,error_m,true_x,true_y,true_z\nstereo,10.0,0.003,0,0,0\n"
        "stereo,10.5,0.004,0,0,0\nstereo,12.5,0.010,0,0,0\nfisheye,10.0,0.020,0,0,0\n");
  const Json json = story_json(read_story(folder.path(), nullptr));
  CHECK(json["span_s"] == 2.5);
  CHECK(json["period_s"] == 0.5);
  REQUIRE(json["losses"].size() == 1);
  CHECK(json["losses"][0]["from"] == 11.0);
  CHECK(json["losses"][0]["cause"] == "dark, few_features");
  CHECK(json["cpu_ms"]["mean"] == 200.0);
  CHECK(json["behind_ms"]["mean"] == 37.5);
  CHECK(json["behind_ms"]["max"] == 90.0);
  REQUIRE(json["error_by_state"].size() == 2);  // no line of the fisheye's in frames.csv
  const Json& in_map = json["error_by_state"][0];
  CHECK(in_map["state"] == "map");
  CHECK(in_map["position_m"]["count"] == 2);
  CHECK(in_map["position_m"]["rmse"].get<double>() == Approx(std::sqrt(12.5) * 1e-3));
  CHECK(in_map["position_m"]["max"] == 0.004);
  CHECK(json["error_by_state"][1]["state"] == "relocalised");
  const Json nothing = story_json(RunStory());
  CHECK(nothing["behind_ms"].is_null());
  CHECK(nothing["losses"].empty());
}

TEST_CASE("the verdict names what speaks against the calibration, and what realtime cost",
          "[report]") {
  const auto text_of = [](const Json& summary, const char* kind, const Json& good) {
    RunStory story;
    story.span = 10;
    story.period = 0.2;
    const Json said = verdict(summary, story, MapFigures());
    for (const Json& reason : said["reasons"]) {
      if (reason["kind"] == kind && reason["good"] == good)
        return reason["text"].get<std::string>();
    }
    return std::string("none");
  };
  Json summary = {
      {"frames", {{"read", 50}, {"tracked", 50}, {"dropped", 0}}},
      {"components", 1},
      {"causes", Json::object()},
      {"seconds", 9.0},
      {"disparity_offset_px", 0.25},
      {"calibration",
       {{"reasons", Json::array()}, {"rows_px", 0.1}, {"disparity_offset_sigma_px", 0.0625}}}};
  CHECK(text_of(summary, "calibration", true) ==
        "calibration: nothing speaks against it; rows off by 0.10 px by place; disparities off by "
        "0.25 px, 1 sigma 0.06 px");
  CHECK(text_of(summary, "time", true) == "9 s for 10 s of images: faster than the cameras");

  summary["calibration"]["reasons"].push_back("rows are 2.00 px off");
  CHECK(text_of(summary, "calibration", false) ==
        "the rig should be calibrated again: rows are 2.00 px off");
  CHECK(text_of(summary, "calibration", true) == "none");

  summary["options"] = {{"mode", "realtime"}, {"rate", 3.0}};
  summary["behind_ms"] = {{"p95", 120.0}};
  CHECK(text_of(summary, "time", true) ==
        "realtime at 3 Hz, the images are of 5 Hz: 0 frames dropped; 95 % of the poses came within "
        "120 ms");
  summary["frames"]["dropped"] = 2;
  CHECK(text_of(summary, "time", false).find(": 2 frames dropped") != std::string::npos);
  summary["fisheye"]["frames"]["dropped"] = 30;
  CHECK(text_of(summary, "time", false).find(": 32 frames dropped") != std::string::npos);
}

TEST_CASE("how uncertain places of parts are is not how uncertain positions are", "[report]") {
  RunStory story;
  const auto add = [&](const char* state, double sigma) {
    RunFrame frame;
    frame.state = state;
    frame.sigma_position = sigma;
    story.frames.push_back(frame);
  };
  add("map", 1e-3);
  add("map", 2e-3);
  add("starting", 50);  // against the part before
  add("map", 4e-3);
  const Json reason = verdict(Json::object(), story, MapFigures())["reasons"][0];
  CHECK(reason["kind"] == "accuracy");
  CHECK(reason["text"] ==
        "no truth to compare with; by its own estimate the position is uncertain by 2 mm (1 sigma, "
        "median), 4 mm at worst");
}

TEST_CASE("the verdict says what the summary says", "[report]") {
  const auto level = [](int read, int tracked, int components) {
    const Json summary = {{"frames", {{"read", read}, {"tracked", tracked}}},
                          {"components", components}};
    return verdict(summary, RunStory(), MapFigures())["level"].get<std::string>();
  };
  CHECK(level(10, 10, 1) == "whole");
  CHECK(level(10, 8, 1) == "gaps");
  CHECK(level(10, 8, 2) == "parts");
  CHECK(level(10, 0, 0) == "nothing");
  CHECK(verdict(Json(), RunStory(), MapFigures())["level"] == "unknown");
  RunStory broken_off;  // without summary.json
  broken_off.frames.emplace_back();
  CHECK(verdict(Json(), broken_off, MapFigures())["reasons"][0]["good"] == true);
}

TEST_CASE("data keep to their size: landmarks are thinned evenly, and it is said", "[report]") {
  const FilledMap map = hybrid_map(0);
  ReportContent content;
  content.figures = map_figures(map.map.view());
  const std::size_t whole = report_data(content, 5'000'000).size();
  const std::size_t bytes = whole - 20'000;
  const std::string text = report_data(content, bytes);
  CHECK(text.size() <= bytes);
  CHECK(text.size() > bytes - 10'000);
  const Json landmarks = Json::parse(text)["landmarks"];
  CHECK(landmarks["of"] == content.figures.landmarks.size());
  CHECK(landmarks["count"].get<std::size_t>() < content.figures.landmarks.size());
}

TEST_CASE("a report is one page of a folder, and of a map alone", "[report]") {
  const TempFolder folder;
  write(folder.path() / "frames.csv", kFrames);
  write(folder.path() / "summary.json",
        R"({"sequence": "</script><b>", "frames": {"read": 5, "tracked": 3}, "components": 1})");
  const FilledMap map = hybrid_map(0);
  save_map(folder.path() / "map.hslam", map.map.view(), {"a program", "some: options"});

  const auto page = report_of(folder.path());
  CHECK(page == folder.path() / "report.html");
  const std::string text = read_text_file(page);
  CHECK(text.find("<b>") == std::string::npos);
  CHECK(text.find("/*") == text.find("/* Colours"));  // every place is filled
  CHECK(text.find("src=\"http") == std::string::npos);
  const Json data = data_of(page);
  CHECK(data["title"] == "</script><b>");
  CHECK(data["frames"]["count"] == 6);
  CHECK(data["verdict"]["level"] == "gaps");
  CHECK(data["map_program"] == "a program");
  CHECK(data["landmarks"]["count"] == map.map.view().landmark_count());
  CHECK(data["keyframes"]["count"] == map.map.view().keyframe_count());

  const auto alone = report_of(folder.path() / "map.hslam", folder.path() / "map.html");
  const Json of_map = data_of(alone);
  CHECK(of_map["frames"]["count"] == 0);
  CHECK(of_map["title"] == "map.hslam");
  CHECK(of_map["summary"].is_null());
}

TEST_CASE("what is no run is refused in one line", "[report]") {
  const TempFolder folder;
  CHECK_THROWS_AS(report_of(folder.path()), InputError);
  CHECK_THROWS_AS(report_of(folder.path() / "nothing.hslam"), InputError);
  write(folder.path() / "frames.csv", kFrames);
  write(folder.path() / "summary.json", "{");
  CHECK_THROWS_AS(report_of(folder.path()), InputError);
}

TEST_CASE("a JPEG file that was written is read as the same picture", "[report]") {
  const TempFolder folder;
  GrayImage image{64, 48, {}};
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      image.pixels.push_back(static_cast<std::uint8_t>(2 * x + y));
    }
  }
  write(folder.path() / "picture.jpg", encode_jpeg(image, 90));
  const GrayImage read = read_gray_image(folder.path() / "picture.jpg");
  REQUIRE(read.width == image.width);
  REQUIRE(read.height == image.height);
  int worst = 0;
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    worst = std::max(worst, std::abs(image.pixels[i] - read.pixels[i]));
  }
  CHECK(worst <= 4);
  CHECK_THROWS_AS(encode_jpeg(GrayImage(), 90), std::logic_error);
}

}  // namespace hybrid_slam
