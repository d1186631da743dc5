#include "apps/io/graphs/colmap.h"

#include <cstring>
#include <limits>

#include <catch2/catch.hpp>

#include "backend/problem/solve_graph.h"
#include "test/apps/graphs/graph_checks.h"
#include "test/support/shared_cases.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

// Every camera model; an image without points, with a blank in its name, and points without a
// track. Ids neither ascend nor start at 1.
const TextFiles kModel{{"cameras.txt",
                        "# Camera list\n"
                        "4 PINHOLE 640 480 500 510 320.5 240.25\n"
                        "1 SIMPLE_PINHOLE 640 480 500 320.5 240.5\n"
                        "2 SIMPLE_RADIAL 640 480 500 320.5 240.5 -0.1\n"
                        "7 RADIAL 640 480 500 320.5 240.5 -0.1 0.02\n"
                        "3 OPENCV_FISHEYE 640 640 300 301 320.5 319.5 0.01 -0.02 0.003 -0.0004\n"},
                       {"images.txt",
                        "# Image list\n"
                        "12 1 0 0 0 0 0 0 4 first image.jpg\n"
                        "371.5 240.25 80 10.125 20.25 -1 300 190 90\n"
                        "5 0.8 0 0.6 0 1 2 3 1 b.jpg\n"
                        "\n"
                        "6 1 0 0 0 -0.5 0.25 0.125 2 c.jpg\n"
                        "310 250 80 260.5 200.5 90 1 2 -1\n"
                        "7 1 0 0 0 -1 0 0 7 d.jpg\n"
                        "280 240 80\n"
                        "8 0.6 0 0 0.8 0 0 0.5 3 e/f.jpg\n"
                        "321 330.5 80 0.5 0.25 -1 300 300 90\n"},
                       {"points3D.txt",
                        "# 3D point list\n"
                        "80 0.5 0 5 255 0 17 0.75 12 0 6 0 7 0 8 0\n"
                        "18446744073709551614 1 1 1 1 2 3 -1\n"
                        "90 -0.25 -0.5 5.5 9 8 7 1.5 12 2 6 1 8 2\n"}};

// As newer versions have it: a rig per camera, a frame per image.
TextFiles with_rigs() {
  TextFiles files = kModel;
  files["rigs.txt"] =
      "40 1 CAMERA 4\n10 1 CAMERA 1\n20 2 CAMERA 2 IMU 1 0\n70 1 CAMERA 7\n"
      "30 2 IMU 9 CAMERA 3 1 1 0 0 0 0.5 0 0\n";
  files["frames.txt"] =
      "1 40 1 0 0 0 0 0 0 1 CAMERA 4 12\n"
      "2 10 0.8 0 0.6 0 1 2 3 1 CAMERA 1 5\n"
      "3 20 1 0 0 0 -0.5 0.25 0.125 2 CAMERA 2 6 IMU 1 6\n"
      "4 70 1 0 0 0 -1 0 0 1 CAMERA 7 7\n"
      "5 30 0.6 0 0 0.8 -0.5 0 0.5 1 CAMERA 3 8\n";
  return files;
}

void write_files(const fs::path& folder, const TextFiles& files) {
  for (const auto& [name, text] : files) write_text(folder / name, text);
}

void patch(const fs::path& path, std::size_t at, const void* bytes, std::size_t count) {
  std::string content = read_text(path);
  REQUIRE(at + count <= content.size());
  std::memcpy(content.data() + at, bytes, count);
  write_text(path, content);
}

}  // namespace

TEST_CASE("COLMAP: what the numbers mean") {
  const TempFolder folder;
  write_files(folder.path(), kModel);
  const GraphFile file = read_graph(folder.path());
  const FactorGraph& graph = file.graph;
  CHECK(file.format == GraphFormat::kColmapText);
  CHECK(graph.validate() == "");
  REQUIRE(graph.cameras.size() == 5);
  // The first pixel's centre is COLMAP's (0.5, 0.5) and our (0, 0).
  CHECK(std::get<Calibrated<Pinhole>>(graph.cameras[0].camera).params ==
        std::array<double, 4>{500, 510, 320, 239.75});
  CHECK(graph.cameras[0].refined == 0b11);
  CHECK(std::get<Calibrated<Radial>>(graph.cameras[1].camera).params ==
        std::array<double, 5>{500, 320, 240, 0, 0});
  CHECK(graph.cameras[1].refined == 0b1);
  CHECK(std::get<Calibrated<Radial>>(graph.cameras[2].camera).params ==
        std::array<double, 5>{500, 320, 240, -0.1, 0});
  CHECK(graph.cameras[2].refined == 0b01001);
  CHECK(std::get<Calibrated<Radial>>(graph.cameras[3].camera).params ==
        std::array<double, 5>{500, 320, 240, -0.1, 0.02});
  CHECK(graph.cameras[3].refined == 0b11001);
  CHECK(std::get<Calibrated<KannalaBrandt>>(graph.cameras[4].camera).params ==
        std::array<double, 8>{300, 301, 320, 319, 0.01, -0.02, 0.003, -0.0004});
  CHECK(graph.cameras[4].refined == 0b11110011);
  CHECK(image_height(graph.cameras[4].camera) == 640);
  REQUIRE(graph.frames.size() == 5);
  CHECK(file.frame_names[0] == "first image.jpg");
  CHECK(graph.frames[0].fixed);
  CHECK_FALSE(graph.frames[1].fixed);
  CHECK(graph.frames[1].cam_from_world.translation() == Eigen::Vector3d(1, 2, 3));
  CHECK(graph.frames[1].cam_from_world.rotation().y() == Approx(0.6));
  CHECK(graph.frames[4].camera == 4);
  CHECK(file.point_ids == std::vector<std::uint64_t>{80, 18446744073709551614U, 90});
  REQUIRE(graph.observations.size() == 7);
  CHECK(graph.observations[0].measurement.head<2>() == Eigen::Vector2d(371, 239.75));
  CHECK(graph.observations[1].point == 2);
  // (0.5, 0, 5) is seen 50 px right of the principal point, and was measured one pixel beyond.
  FactorGraph single = graph;
  single.observations.resize(1);
  CHECK(reference_cost(single) == Approx(0.5).epsilon(1e-12));
}

TEST_CASE("COLMAP: text and binary hold the same, and all of it") {
  const TempFolder folder;
  const bool rigs = GENERATE(false, true);
  const fs::path input = folder.path() / "input";
  write_files(input, rigs ? with_rigs() : kModel);
  check_round_trip(input);
  const GraphFile file = read_graph(input);
  CHECK(file.warnings.empty());
  REQUIRE(file.writers.size() == 3);  // the map file, too
  const fs::path binary = file.writers[1].write(file.graph, folder.path() / "binary");
  CHECK(fs::exists(binary / "rigs.bin") == rigs);
  CHECK_FALSE(fs::exists(binary / "cameras.txt"));
  check_round_trip(binary);
  // There and back: the same text.
  const fs::path text = file.writers[0].write(file.graph, folder.path() / "text");
  const GraphFile from_binary = read_graph(binary);
  CHECK(from_binary.format == GraphFormat::kColmapBinary);
  const fs::path again = from_binary.writers[1].write(from_binary.graph, folder.path() / "again");
  for (const char* const name : {"cameras", "images", "points3D", "rigs", "frames"}) {
    if (!rigs && !fs::exists(text / (name + std::string(".txt")))) continue;
    CAPTURE(name);
    CHECK(read_text(text / (name + std::string(".txt"))) ==
          read_text(again / (name + std::string(".txt"))));
  }
  const ColmapModel model = read_colmap_text(text);
  CHECK(model.images[0].name == "first image.jpg");
  CHECK(model.images[0].points[1].point == ColmapPoint2d::kNoPoint);
  CHECK(model.images[0].points[1].pixel == Eigen::Vector2d(10.125, 20.25));
  CHECK(model.images[1].points.empty());
  CHECK(model.points[0].color == std::array<std::uint8_t, 3>{255, 0, 17});
  CHECK(model.points[0].track.size() == 4);
  CHECK(model.points[1].error == -1);
  CHECK(model.cameras[2].params == std::vector<double>{500, 320.5, 240.5, -0.1});
  if (rigs) {
    REQUIRE(model.rigs.size() == 5);
    CHECK(model.rigs[2].others.size() == 1);
    CHECK_FALSE(model.rigs[2].others[0].sensor_from_rig.has_value());
    CHECK(model.frames[2].data.size() == 2);
  }
}

TEST_CASE("COLMAP: a result of one variant does not hide behind an older one of the other") {
  const TempFolder folder;
  write_files(folder.path() / "input", kModel);
  const GraphFile file = read_graph(folder.path() / "input");
  file.writers[1].write(file.graph, folder.path());
  CHECK(read_graph(file.writers[0].write(file.graph, folder.path())).format ==
        GraphFormat::kColmapText);
}

TEST_CASE("COLMAP: the frames of rigs follow their images") {
  const TempFolder folder;
  write_files(folder.path() / "input", with_rigs());
  GraphFile file = read_graph(folder.path() / "input");
  const Rigid3d moved(Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5), {7, 8, 9});
  for (const std::size_t i : {2, 4}) file.graph.frames[i].cam_from_world = moved;
  const ColmapModel model = read_colmap_text(file.writers[0].write(file.graph, folder.path()));
  CHECK(model.images[2].cam_from_world.params.isApprox(moved.params, 1e-14));
  CHECK(model.frames[2].rig_from_world.params.isApprox(moved.params, 1e-14));
  // Its camera sits 0.5 beside the rig's reference: cam_from_world = cam_from_rig rig_from_world.
  CHECK(model.frames[4].rig_from_world.translation().isApprox(Eigen::Vector3d(6.5, 8, 9), 1e-14));
}

TEST_CASE("COLMAP: images that a rig joins stay rigid, and frames rule over images") {
  const TempFolder folder;
  TextFiles files = with_rigs();
  files["rigs.txt"] = "1 2 CAMERA 4 CAMERA 2 1 1 0 0 0 -0.5 0.25 0.125\n";
  files["frames.txt"] = "1 1 1 0 0 0 0 0 0 2 CAMERA 4 12 CAMERA 2 6\n";
  write_files(folder.path() / "input", files);
  const GraphFile file = read_graph(folder.path() / "input");
  CHECK(file.warnings.empty());
  REQUIRE(file.graph.edges.size() == 1);
  CHECK(file.graph.edges[0].a == 0);
  CHECK(file.graph.edges[0].b == 2);
  const ColmapModel model = read_colmap_text(file.writers[0].write(file.graph, folder.path()));
  REQUIRE(model.rigs.size() == 1);
  REQUIRE(model.frames.size() == 1);
  CHECK(model.images[2].cam_from_world.params == file.graph.frames[2].cam_from_world.params);

  files["frames.txt"] = "1 1 1 0 0 0 0 0 2 2 CAMERA 4 12 CAMERA 2 6\n";
  write_files(folder.path() / "stale", files);
  const GraphFile stale = read_graph(folder.path() / "stale");
  REQUIRE(stale.warnings.size() == 1);
  CHECK(stale.warnings[0].find("images.txt: poses of 2 of 5 images contradict those of frames.txt, "
                               "which rule (by up to 0 degrees, 2 in length)") !=
        std::string::npos);
  CHECK(stale.graph.frames[0].cam_from_world.translation() == Eigen::Vector3d(0, 0, 2));
  CHECK(stale.graph.frames[2].cam_from_world.translation() == Eigen::Vector3d(-0.5, 0.25, 2.125));
}

TEST_CASE("COLMAP: sensors of a rig that are apart by rounding alone are at one place") {
  const TempFolder folder;
  const auto information = [&](const std::string& distance) {
    TextFiles files = with_rigs();
    files["rigs.txt"] = "1 2 CAMERA 4 CAMERA 2 1 1 0 0 0 " + distance + " 0 0\n";
    files["frames.txt"] = "1 1 1 0 0 0 0 0 0 2 CAMERA 4 12 CAMERA 2 6\n";
    write_files(folder.path() / distance, files);
    const GraphFile file = read_graph(folder.path() / distance);
    CHECK(file.graph.validate() == "");
    return file.graph.edges.at(0).information;
  };
  const Matrix6d at_one_place = information("0");
  CHECK(information("1e-17") == at_one_place);
  CHECK(information("1e-160") == at_one_place);
  CHECK(information("0.5")(0, 0) == Approx(4 * at_one_place(0, 0)));
}

TEST_CASE("COLMAP: a stale model of the cases is the consistent one") {
  const auto cases = shared_cases("colmap");
  if (!cases) return;
  const GraphFile consistent = read_graph(*cases / "consistent");
  const GraphFile stale = read_graph(*cases / "stale");
  CHECK(consistent.warnings.empty());
  REQUIRE(stale.warnings.size() == 1);
  CHECK(stale.warnings[0].find("of 10 images contradict") != std::string::npos);
  CHECK(cost(consistent.graph) == Approx(53.08).epsilon(1e-3));
  CHECK(cost(stale.graph) == Approx(cost(consistent.graph)).epsilon(1e-9));
  // Solved, the pair is as far apart as before.
  FactorGraph solved = stale.graph;
  ProblemOptions options;
  options.rounds.assign(1, {50, Loss::kNone, 1e-10});
  const GraphSummary summary = solve_graph(solved, options);
  CHECK(summary.final_cost < 0.99 * summary.initial_cost);
  const TempFolder folder;
  const GraphFile again = read_graph(stale.writers[0].write(solved, folder.path()));
  CHECK(again.warnings.empty());
  const auto& frames = again.graph.frames;
  for (const GraphEdge& edge : stale.graph.edges) {
    const Rigid3d moved = frames[edge.a].cam_from_world * inverse(frames[edge.b].cam_from_world);
    CHECK((moved.translation() - edge.a_from_b.translation()).norm() < 1e-12);
  }
  CHECK(cost(again.graph) == Approx(summary.final_cost).epsilon(1e-4));
}

TEST_CASE("COLMAP text: what is refused") {
  check_faults(kModel, "cameras.txt", "",
               {{"model", "4 PINHOLE", "4 LENS", ":2: camera model \"LENS\" is not supported"},
                {"truncated", " -0.1 0.02\n", " -0.1\n", ":5: parameter is missing"},
                {"too many", " -0.1 0.02\n", " -0.1 0.02 1\n", ":5: expected the end of the line"},
                {"the same id", "1 SIMPLE", "4 SIMPLE", ":3: camera 4 is there already"},
                {"NaN", "500 510", "nan 510", ":2: \"nan\" is not finite"},
                {"no focal length", "500 510", "500 0", ":2: the focal length must be positive"},
                {"an absurd size", "640 480 500 510", "99999999999 480 500 510", ":2: width: "},
                {"a camera missing", "7 RADIAL 640 480 500 320.5 240.5 -0.1 0.02\n", "",
                 "images.txt:8: there is no camera 7"}});
  check_faults(
      kModel, "images.txt", "",
      {{"the same id", "5 0.8", "12 0.8", ":4: image 12 is there already"},
       {"no such camera", "0 0 0 4 first", "0 0 0 5 first", ":2: there is no camera 5"},
       {"no such point", "10.125 20.25 -1", "10.125 20.25 81",
        ":2: image 12 names point 81, which there is not"},
       {"a negative point", "10.125 20.25 -1", "10.125 20.25 -2", ":3: point: \"-2\""},
       {"NaN", "371.5", "nan", ":3: \"nan\" is not finite"},
       {"no rotation", "12 1 0 0 0", "12 2 0 0 0", ":2: the quaternion is not of unit length"},
       {"no name", " 1 b.jpg", " 1", ":4: the image's name is missing"},
       {"truncated", " 190 90", " 190", ":3: point is missing"},
       {"a line missing", "371.5 240.25 80 10.125 20.25 -1 300 190 90\n", "", "image"},
       {"an observation missing", " 300 190 90", "",
        "points3D.txt:4: the track of point 90 names point 2 of image 12, which is not its"}});
  check_faults(
      kModel, "points3D.txt", "",
      {{"the same id", "90 -0.25", "80 -0.25", ":4: point 80 is there already"},
       {"a point missing", "90 -0.25", "# 90 -0.25", "images.txt:2: image 12 names point 90"},
       {"NaN", "80 0.5", "80 nan", ":2: \"nan\" is not finite"},
       {"a color", "255 0 17", "256 0 17", ":2: color: 256 is above 255"},
       {"no such image", "12 0 6 0", "13 0 6 0", ":2: the track of point 80 names image 13"},
       {"index out of range", "12 0 6 0", "12 99 6 0", ":2: the track of point 80 names point 99"},
       {"another's", "12 0 6 0", "12 2 6 0", ":2: the track of point 80 names point 2 of image 12"},
       {"half an element", "12 0 6 0 7 0 8 0", "12 0 6 0 7 0 8", ":2: point index of the track"}});
  const TextFiles files = with_rigs();
  check_faults(
      files, "rigs.txt", "",
      {{"the same id", "10 1", "40 1", ":2: rig 40 is there already"},
       {"another sensor", "CAMERA 7", "RADAR 7", ":4: sensor type \"RADAR\" is neither"},
       {"an absurd count", "70 1", "70 4000000000", ":4: sensor's type is missing"},
       {"a rig missing", "70 1 CAMERA 7\n", "", "frames.txt:4: there is no rig 70"},
       {"a length beyond all", "0 0.5 0 0", "0 1e200 0 0", ":5: sensor 3 is too far away"}});
  check_faults(
      files, "frames.txt", "",
      {{"the same id", "2 10 0.8", "1 10 0.8", ":2: frame 1 is there already"},
       {"a sensor of another rig", "CAMERA 1 5", "CAMERA 2 5", ":2: rig 10 has no sensor"},
       {"the same image", "CAMERA 1 5", "CAMERA 1 12", ":2: image 12 is in another"},
       {"a length beyond all", "0 1 2 3 1", "0 1 2 -1e200 1", ":2: the rig is too far away"},
       {"an absurd count", "1 CAMERA 4 12", "4000000000 CAMERA 4 12",
        ":1: sensor's type is missing"}});
}

TEST_CASE("COLMAP binary: any truncation, any trailing byte and any absurd count is refused") {
  const TempFolder folder;
  write_files(folder.path() / "input", with_rigs());
  const GraphFile file = read_graph(folder.path() / "input");
  const fs::path model = file.writers[1].write(file.graph, folder.path());
  for (const char* const name : {"cameras", "images", "points3D", "rigs", "frames"}) {
    CAPTURE(name);
    const fs::path path = model / (name + std::string(".bin"));
    const std::string whole = read_text(path);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      write_text(path, whole.substr(0, size));
      const std::string reason = refusal(model);
      CAPTURE(size);
      CHECK_THAT(reason, Catch::StartsWith(path.string() + ": byte "));
    }
    write_text(path, whole + '\0');
    CHECK_THAT(refusal(model), Catch::Contains("expected the end of the file, found 1 more"));
    const std::uint64_t absurd = std::numeric_limits<std::uint64_t>::max() / 2;
    write_text(path, whole);
    patch(path, 0, &absurd, sizeof(absurd));
    CHECK_THAT(refusal(model), Catch::Contains(": byte 0: promises 9223372036854775807 "));
    write_text(path, whole);
    CHECK(refusal(model).empty());
  }
}

TEST_CASE("COLMAP binary: values that are refused") {
  const TempFolder folder;
  write_files(folder.path() / "input", kModel);
  const GraphFile file = read_graph(folder.path() / "input");
  const fs::path model = file.writers[1].write(file.graph, folder.path());
  const auto refused = [&](const char* name, std::size_t at, auto value, const char* reason) {
    const std::string whole = read_text(model / name);
    patch(model / name, at, &value, sizeof(value));
    CHECK_THAT(refusal(model),
               Catch::StartsWith((model / name).string() + ": byte ") && Catch::Contains(reason));
    write_text(model / name, whole);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused("cameras.bin", 8 + 4, std::int32_t{99}, "camera model 99 is not supported");
  refused("cameras.bin", 8 + 4, std::int32_t{-1}, "camera model -1 is not supported");
  refused("cameras.bin", 8 + 8, std::uint64_t{1} << 40, "the image is too large");
  refused("cameras.bin", 8 + 24, nan, "byte 32: a number that is not finite");
  refused("cameras.bin", 8 + 56, std::uint32_t{4}, "camera 4 is there already");
  refused("images.bin", 8 + 4, nan, "a number that is not finite");
  refused("images.bin", 8 + 4, 3.0, "the quaternion is not of unit length");
  refused("images.bin", 8 + 60, std::uint32_t{99}, "there is no camera 99");
  refused("images.bin", 8 + 64 + 16, std::uint64_t{1} << 60, "promises 1152921504606846976 points");
  refused("points3D.bin", 8 + 8, nan, "a number that is not finite");
  refused("points3D.bin", 8 + 43, std::uint64_t{1} << 60, "elements of a track");
}

TEST_CASE("COLMAP: files that are missing") {
  const TempFolder folder;
  for (const char* const name : {"cameras.txt", "images.txt", "points3D.txt"}) {
    write_files(folder.path(), kModel);
    fs::remove(folder.path() / name);
    CHECK_FALSE(refusal(folder.path()).empty());
  }
  write_files(folder.path(), with_rigs());
  fs::remove(folder.path() / "frames.txt");
  CHECK_THAT(refusal(folder.path()), Catch::Contains("frames.txt: no such file"));
}

TEST_CASE("COLMAP: a model of another program, of fisheye cameras without points") {
  const auto folder = shared_graphs();
  if (!folder) return;
  const fs::path model = folder->parent_path() / "fisheye_t265/colmap";
  const GraphFile file = read_graph(model);
  CHECK(file.graph.frames.size() == 6);
  CHECK(file.frame_names[1] == "leftraw/frame_000000001.jpg");
  CHECK(std::get<Calibrated<KannalaBrandt>>(file.graph.cameras[1].camera).params[2] == 416.746);
  check_round_trip(model);
}

}  // namespace hybrid_slam
