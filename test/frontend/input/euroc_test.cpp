#include <cmath>
#include <sstream>

#include <catch2/catch.hpp>
#include <opencv2/imgproc.hpp>

#include "cameras/geometry/rigid3d.h"
#include "cameras/kannala_brandt.h"
#include "test/frontend/input/dataset_writer.h"
#include "test/support/shared_cases.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr int kFrames = 6;

struct RawModel {
  double f, cx, cy, k1, k2, p1, p2;
  Rigid3d body_from_cam;
};

RawModel raw_model(int side) {
  const double s = side;
  const Eigen::Quaterniond turn(
      Eigen::AngleAxisd(0.03, Eigen::Vector3d(1 - 2 * s, 2, s).normalized()));
  return {250 + 4 * s, 158 - 3 * s,
          122 + 2 * s, -0.3 + 0.02 * s,
          0.08,        1e-3,
          -5e-4 * s,   Rigid3d(turn, Eigen::Vector3d(0.01 + 0.11 * s, 0.02 - 0.01 * s, 0.005))};
}

Eigen::Vector2d distort(const RawModel& m, const Eigen::Vector3d& point_in_cam) {
  const double x = point_in_cam.x() / point_in_cam.z(), y = point_in_cam.y() / point_in_cam.z();
  const double r2 = x * x + y * y;
  const double radial = 1 + m.k1 * r2 + m.k2 * r2 * r2;
  return {m.f * (x * radial + 2 * m.p1 * x * y + m.p2 * (r2 + 2 * x * x)) + m.cx,
          m.f * (y * radial + m.p1 * (r2 + 2 * y * y) + 2 * m.p2 * x * y) + m.cy};
}

Rigid3d world_from_body(double time) {
  return {
      Eigen::Quaterniond(Eigen::AngleAxisd(0.2 * time, Eigen::Vector3d(0.2, 1, 0.1).normalized())),
      Eigen::Vector3d(0.3 * time, -0.1 * time, 0.05 * time)};
}

// A blob at every point that the camera sees.
cv::Mat render(const RawModel& m, const Rigid3d& cam_from_world,
               const std::vector<Eigen::Vector3d>& points) {
  cv::Mat image(kHeight, kWidth, CV_64FC1, cv::Scalar(20));
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector2d centre = distort(m, cam_from_world * point);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double r2 = (Eigen::Vector2d(x, y) - centre).squaredNorm();
        image.at<double>(y, x) += 200 * std::exp(-r2 / (2 * 2.0 * 2.0));
      }
    }
  }
  cv::Mat result;
  image.convertTo(result, CV_8UC1);
  return result;
}

std::vector<Eigen::Vector3d> scene() {
  std::vector<Eigen::Vector3d> points;
  for (int y = -2; y <= 2; ++y) {
    for (int x = -2; x <= 2; ++x) {
      const double z = 2.5 + 0.1 * x + 0.15 * y;
      points.emplace_back(0.21 * x * z + 0.1, 0.16 * y * z, z);
    }
  }
  return points;
}

std::string sensor_yaml(const RawModel& m) {
  const Eigen::Matrix3d r = m.body_from_cam.rotation().toRotationMatrix();
  const Eigen::Vector3d t = m.body_from_cam.translation();
  std::string text = "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [";
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) text += cv::format("%.12f, ", r(i, j));
    text += cv::format("%.12f,\n    ", t[i]);
  }
  text += "0.0, 0.0, 0.0, 1.0]\nrate_hz: 20\nresolution: [320, 240]\ncamera_model: pinhole\n";
  text += cv::format("intrinsics: [%.9f, %.9f, %.9f, %.9f]\n", m.f, m.f, m.cx, m.cy);
  text += "distortion_model: radial-tangential\n";
  text += cv::format("distortion_coefficients: [%.9f, %.9f, %.9f, %.9f]\n", m.k1, m.k2, m.p1, m.p2);
  return text;
}

std::int64_t stamp(int frame) { return 1403636579763555584 + frame * std::int64_t{50'000'000}; }

void write_euroc(const fs::path& root) {
  for (int side = 0; side < 2; ++side) {
    const RawModel m = raw_model(side);
    const fs::path folder = root / "mav0" / ("cam" + std::to_string(side));
    write_text(folder / "sensor.yaml", sensor_yaml(m));
    std::string list = "#timestamp [ns],filename\r\n";
    for (int i = 0; i < kFrames; ++i) {
      const std::string name = std::to_string(stamp(i)) + ".png";
      list += std::to_string(stamp(i)) + "," + name + "\r\n";
      const Rigid3d world_from_cam = world_from_body(0.05 * i) * m.body_from_cam;
      write_picture(folder / "data" / name, render(m, inverse(world_from_cam), scene()));
    }
    write_text(folder / "data.csv", list);
  }
  std::string truth = "#timestamp, p_x, p_y, p_z, q_w, q_x, q_y, q_z, v\n";
  for (int i = 1; i < 60; ++i) {  // 5 ms apart, starting after the first frame
    const Rigid3d pose = world_from_body(0.005 * i - 0.002);
    const auto q = pose.rotation();
    const auto t = pose.translation();
    truth += std::to_string(stamp(0) + i * 5'000'000 - 2'000'000) +
             cv::format(",%.12f,%.12f,%.12f,%.12f,%.12f,%.12f,%.12f,0.5\n", t.x(), t.y(), t.z(),
                        q.w(), q.x(), q.y(), q.z());
  }
  write_text(root / "mav0/state_groundtruth_estimate0/data.csv", truth);
}

// Weighted centre of the blob nearest to `guess`; more than 4 px away it is another one.
Eigen::Vector2d blob_centre(const GrayImage& image, Eigen::Vector2d guess) {
  for (int iteration = 0; iteration < 5; ++iteration) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double weight = 0;
    const int x0 = static_cast<int>(std::lround(guess.x()));
    const int y0 = static_cast<int>(std::lround(guess.y()));
    for (int y = y0 - 8; y <= y0 + 8; ++y) {
      for (int x = x0 - 8; x <= x0 + 8; ++x) {
        if (x < 0 || y < 0 || x >= image.width || y >= image.height) continue;
        const double w = std::max(0, image.row(y)[x] - 22);
        sum += w * Eigen::Vector2d(x, y);
        weight += w;
      }
    }
    if (weight > 0) guess = sum / weight;
  }
  return guess;
}

// Points of the scene lie in the images where rectified cameras on the true path see them [px].
void check_points(const ImageSequence& sequence, double tolerance) {
  const SequenceInfo& info = sequence.info();
  const auto [fx, fy, cx, cy, baseline] = info.stereo.params;
  int seen = 0;
  for (const StampedPose& truth : {info.truth[0], info.truth[4]}) {
    const auto frame = std::find(info.times.begin(), info.times.end(), truth.time);
    REQUIRE(frame != info.times.end());
    const FrameImages images = sequence.read(static_cast<std::size_t>(frame - info.times.begin()));
    for (const Eigen::Vector3d& point_in_world : scene()) {
      const Eigen::Vector3d point = inverse(truth.world_from_cam) * point_in_world;
      const Eigen::Vector2d left(fx * point.x() / point.z() + cx, fy * point.y() / point.z() + cy);
      const Eigen::Vector2d right(left.x() - fx * baseline / point.z(), left.y());
      if (right.x() < 12 || left.x() > kWidth - 12 || left.y() < 12 || left.y() > kHeight - 12) {
        continue;
      }
      ++seen;
      CHECK((blob_centre(images.left, left) - left).norm() < tolerance);
      CHECK((blob_centre(images.right, right) - right).norm() < tolerance);
    }
  }
  CHECK(seen > 20);
}

TEST_CASE("EuRoC images are rectified: points fall where the calibration and the truth say") {
  const TempFolder folder;
  write_euroc(folder.path());
  const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  const SequenceInfo& info = sequence->info();
  CHECK(info.layout == "euroc");
  REQUIRE(sequence->size() == kFrames);
  CHECK(info.warnings.empty());
  CHECK(info.times[2] - info.times[0] == Approx(0.1).margin(1e-6));
  const Rigid3d right_from_left = inverse(raw_model(1).body_from_cam) * raw_model(0).body_from_cam;
  const auto [fx, fy, cx, cy, baseline] = info.stereo.params;
  CHECK(baseline == Approx(right_from_left.translation().norm()).epsilon(1e-9));
  CHECK(fx == fy);
  REQUIRE(info.truth.size() == kFrames - 1);  // none for the first frame
  CHECK(info.truth_has_rotation);
  check_points(*sequence, 0.08);
}

TEST_CASE("EuRoC cameras of unequal size become a pair of the left one's") {
  const TempFolder folder;
  write_euroc(folder.path());
  const fs::path camera = folder.path() / "mav0/cam1";
  for (const auto& entry : fs::directory_iterator(camera / "data")) {
    cv::Mat half;
    cv::resize(cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE), half, {}, 0.5, 0.5,
               cv::INTER_AREA);
    write_picture(entry.path(), half);
  }
  RawModel m = raw_model(1);
  m.f /= 2;
  m.cx = (m.cx + 0.5) / 2 - 0.5;
  m.cy = (m.cy + 0.5) / 2 - 0.5;
  write_text(camera / "sensor.yaml", sensor_yaml(m));
  replace_text(camera / "sensor.yaml", "[320, 240]", "[160, 120]");
  const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  REQUIRE(sequence->info().warnings.size() == 1);
  CHECK(sequence->info().warnings[0].find("rectified to a field of view of") != std::string::npos);
  CHECK(sequence->info().stereo.width == kWidth);
  const FrameImages images = sequence->read(0);
  CHECK(images.right.width == kWidth);
  CHECK(images.right.height == kHeight);
  check_points(*sequence, 0.25);  // half a pixel of the right image is one of the pair
}

TEST_CASE("EuRoC's list of images of the cases, without a # before the columns' names") {
  const auto cases = shared_cases("euroc");
  if (!cases) return;
  const TempFolder folder;
  write_euroc(folder.path());
  const fs::path list = *cases / "data_without_hash.csv";
  int listed = 0;
  for (int side = 0; side < 2; ++side) {
    const fs::path camera = folder.path() / "mav0" / ("cam" + std::to_string(side));
    std::istringstream lines(read_text(list));
    std::string line;
    std::getline(lines, line);
    CHECK(line == "timestamp,filename");
    for (listed = 0; std::getline(lines, line); ++listed) {
      fs::copy_file(camera / "data" / (std::to_string(stamp(0)) + ".png"),
                    camera / "data" / line.substr(line.find(',') + 1));
    }
    fs::copy_file(list, camera / "data.csv", fs::copy_options::overwrite_existing);
  }
  fs::remove_all(folder.path() / "mav0/state_groundtruth_estimate0");
  const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  CHECK(sequence->size() == static_cast<std::size_t>(listed));
  CHECK(sequence->info().times[0] == 1);
  CHECK(sequence->info().times[1] == Approx(1.1).epsilon(1e-12));
}

TEST_CASE("EuRoC opens from mav0 and from a folder of sequences") {
  const TempFolder folder;
  write_euroc(folder.path() / "V1_01");
  for (const auto& [path, name] : {std::pair(folder.path(), "V1_01"), std::pair(folder.path(), ""),
                                   std::pair(folder.path() / "V1_01/mav0", "")}) {
    const auto sequence = open_sequence(path.string(), SequenceLayout::kAuto, name);
    CHECK(sequence->size() == kFrames);
    CHECK(sequence->info().name == "V1_01");
  }
  CHECK(open_complaint(folder.path(), "V1_02").find("there is: V1_01") != std::string::npos);
}

TEST_CASE("EuRoC frames are matched by time") {
  const TempFolder folder;
  write_euroc(folder.path());
  const std::string third = std::to_string(stamp(2)), fifth = std::to_string(stamp(4));
  replace_text(folder.path() / "mav0/cam1/data.csv", third + "," + third + ".png\r\n", "");
  // A fifth image taken 1 ms later on the right still belongs to the left one.
  replace_text(folder.path() / "mav0/cam1/data.csv", fifth + ",",
               std::to_string(stamp(4) + 1'000'000) + ",");
  const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  CHECK(sequence->size() == kFrames - 1);
  CHECK(sequence->info().times[2] - sequence->info().times[1] == Approx(0.1).margin(1e-6));
  REQUIRE(sequence->info().warnings.size() == 1);
  CHECK(sequence->info().warnings[0].find("1 of cam0's and 0 of cam1's") != std::string::npos);

  fs::remove(folder.path() / "mav0/cam0/data" / (fifth + ".png"));
  const auto holed = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  CHECK(holed->info().warnings.size() == 2);
  CHECK(complaint([&] { holed->read(3); }).find("no left image") != std::string::npos);
  CHECK(complaint([&] { holed->read(4); }).empty());
}

// The clock of the right camera put off by so many ns, and every `keep`th of its images kept.
void rewrite_right_list(const fs::path& root, std::int64_t offset, int keep = 1) {
  std::ostringstream list;
  list << "timestamp,filename,exposure\n";
  for (int i = 0; i < kFrames; i += keep) {
    list << '"' << stamp(i) + offset << "\"," << stamp(i) << ".png,0.01,\n";
  }
  write_text(root / "mav0/cam1/data.csv", list.str());
}

TEST_CASE("EuRoC cameras out of step are paired, and said to be") {
  const TempFolder folder;
  write_euroc(folder.path());
  const auto open = [&](double tolerance) {
    InputOptions options;
    options.pair_tolerance = tolerance;
    return open_sequence(folder.path().string(), SequenceLayout::kAuto, "",
                         SequenceCameras::kStereo, TruthConvention::kAuto, options);
  };
  for (const std::int64_t offset : {4'000'000, -12'000'000}) {
    rewrite_right_list(folder.path(), offset);
    const auto sequence = open(0);
    CHECK(sequence->size() == kFrames);
    CHECK(sequence->info().times[0] == Approx(static_cast<double>(stamp(0)) * 1e-9).epsilon(1e-15));
    REQUIRE(sequence->info().warnings.size() == 1);
    CHECK(sequence->info().warnings[0].find(offset > 0 ? "cam1's times are 4 ms later"
                                                       : "cam1's times are -12 ms later") !=
          std::string::npos);
  }
  rewrite_right_list(folder.path(), 0, 2);
  CHECK(open(0)->size() == kFrames / 2);
  // Differences that are not one offset: 0, 3, 6 ... ms; the tolerance is 5 ms, or as given.
  std::string list;
  for (int i = 0; i < kFrames; ++i) {
    list += std::to_string(stamp(i) + 3'000'000LL * i) + "," + std::to_string(stamp(i)) + ".png\n";
  }
  write_text(folder.path() / "mav0/cam1/data.csv", list);
  CHECK(open(0)->size() == 2);
  CHECK(open(0.0071)->size() == 3);
}

TEST_CASE("EuRoC distortions by their other names and lengths") {
  const TempFolder folder;
  write_euroc(folder.path());
  const auto plain = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  const auto rewrite = [&](const std::string& name, const std::string& more) {
    for (int side = 0; side < 2; ++side) {
      const fs::path file = folder.path() / "mav0" / ("cam" + std::to_string(side)) / "sensor.yaml";
      const std::string text = sensor_yaml(raw_model(side));  // ends with "]\n"
      std::ostringstream changed;
      changed << std::string_view(text).substr(0, text.size() - 2) << more << "]\n";
      write_text(file, changed.str());
      replace_text(file, "radial-tangential", name);
    }
  };
  for (const auto& [name, more] : {std::pair("plumb_bob", ", 0.0"), std::pair("radtan", ""),
                                   std::pair("rational_polynomial", ", 0.0, 0.0, 0.0, 0.0")}) {
    INFO(name);
    rewrite(name, more);
    const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
    CHECK(sequence->info().stereo.params[0] == Approx(plain->info().stereo.params[0]));
    CHECK(sequence->read(2).left.pixels == plain->read(2).left.pixels);
  }
  rewrite("plumb_bob", ", 0.0, 0.0");
  CHECK(open_complaint(folder.path()).find("must have 4, 5 or 8 numbers") != std::string::npos);
}

// Stereo of two fisheyes, as TUM-VI has it: a camchain, images without sensor.yaml.
TEST_CASE("a pair of fisheyes is rectified to a stated field of view") {
  const TempFolder folder;
  const fs::path mav = folder.path() / "mav0";
  const std::array<double, 8> lens{100, 101, 159, 121, 0.01, -0.004, 0.001, 0};
  const Rigid3d right_from_left(
      Eigen::Quaterniond(Eigen::AngleAxisd(0.03, Eigen::Vector3d(1, 2, 1).normalized())),
      Eigen::Vector3d(-0.1, 0.002, 0.001));
  for (int side = 0; side < 2; ++side) {
    cv::Mat image(kHeight, kWidth, CV_64FC1, cv::Scalar(20));
    for (const Eigen::Vector3d& point : scene()) {
      const Eigen::Vector3d in_cam = side == 0 ? point : right_from_left * point;
      Eigen::Vector2d centre;
      REQUIRE(KannalaBrandt::project(lens.data(), in_cam.data(), centre.data()));
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const double r2 = (Eigen::Vector2d(x, y) - centre).squaredNorm();
          image.at<double>(y, x) += 200 * std::exp(-r2 / (2 * 1.5 * 1.5));
        }
      }
    }
    cv::Mat bytes;
    image.convertTo(bytes, CV_8UC1);
    const fs::path camera = mav / ("cam" + std::to_string(side));
    write_picture(camera / "data/1000000000.png", bytes);
    write_text(camera / "data.csv", "#timestamp [ns],filename\n1000000000,1000000000.png\n");
  }
  const Eigen::Matrix3d r = right_from_left.rotation().toRotationMatrix();
  const Eigen::Vector3d t = right_from_left.translation();
  std::string chain;
  for (int side = 0; side < 2; ++side) {
    chain += cv::format("cam%d:\n  camera_model: pinhole\n  distortion_model: equidistant\n", side);
    chain += "  intrinsics: [100, 101, 159, 121]\n  distortion_coeffs: [0.01, -0.004, 0.001, 0]\n";
    chain += "  resolution: [320, 240]\n";
    if (side == 0) continue;
    chain += "  T_cn_cnm1:\n";
    for (int i = 0; i < 3; ++i) {
      chain += cv::format("  - [%.12f, %.12f, %.12f, %.12f]\n", r(i, 0), r(i, 1), r(i, 2), t[i]);
    }
    chain += "  - [0.0, 0.0, 0.0, 1.0]\n";
  }
  write_text(folder.path() / "dso/camchain.yaml", chain);
  const auto sequence = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  const SequenceInfo& info = sequence->info();
  REQUIRE(info.warnings.size() == 1);
  CHECK(info.warnings[0].find("rectified to a field of view of") != std::string::npos);
  CHECK(info.stereo.params[4] == Approx(t.norm()));
  CHECK(info.stereo.params[0] >= 100);
  const FrameImages images = sequence->read(0);
  // The same point in the same row of both, and at its depth.
  const auto& [fx, fy, cx, cy, baseline] = info.stereo.params;
  int seen = 0;
  for (const Eigen::Vector3d& point : scene()) {
    // Rectified axes: x along the baseline.
    const Eigen::Vector3d x = inverse(right_from_left).translation().normalized();
    const Eigen::Vector3d ahead =
        Eigen::Vector3d::UnitZ() + r.transpose() * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d y = ahead.cross(x).normalized();
    const Eigen::Vector3d in_rectified(x.dot(point), y.dot(point), x.cross(y).dot(point));
    const double z = in_rectified.z();
    const Eigen::Vector2d expected(fx * in_rectified.x() / z + cx, fy * in_rectified.y() / z + cy);
    if (!(expected.x() > 12 && expected.x() < kWidth - 12 && expected.y() > 12 &&
          expected.y() < kHeight - 12)) {
      continue;
    }
    const double disparity = fx * baseline / z;
    CHECK((blob_centre(images.left, expected) - expected).norm() < 0.35);
    CHECK((blob_centre(images.right, expected - Eigen::Vector2d(disparity, 0)) - expected +
           Eigen::Vector2d(disparity, 0))
              .norm() < 0.35);
    ++seen;
  }
  CHECK(seen >= 9);
}

TEST_CASE("an EuRoC dataset that cannot be used is refused with one line") {
  const TempFolder folder;
  write_euroc(folder.path());
  const fs::path mav = folder.path() / "mav0";
  std::string expected;

  SECTION("no right camera") {
    fs::remove_all(mav / "cam1");
    expected = "cam1/data.csv: no such file";
  }
  SECTION("cameras exchanged") {
    fs::rename(mav / "cam0/sensor.yaml", mav / "x");
    fs::rename(mav / "cam1/sensor.yaml", mav / "cam0/sensor.yaml");
    fs::rename(mav / "x", mav / "cam1/sensor.yaml");
    expected = "the right camera does not stand to the right of the left one";
  }
  SECTION("not YAML") {
    write_text(mav / "cam0/sensor.yaml", "camera_model: pinhole\n  intrinsics: [1, 2\n");
    expected = "cam0/sensor.yaml:";
  }
  SECTION("not finite") {
    replace_text(mav / "cam1/sensor.yaml", "intrinsics: [254", "intrinsics: [.nan, 254");
    expected = "cam1/sensor.yaml:12: intrinsics: must have 4 numbers";
  }
  SECTION("a distortion that is not finite") {
    replace_text(mav / "cam1/sensor.yaml", "distortion_coefficients: [-0.280000000",
                 "distortion_coefficients: [.nan");
    expected = "cam1/sensor.yaml:14: distortion_coefficients: is not finite";
  }
  SECTION("negative focal length") {
    replace_text(mav / "cam0/sensor.yaml", "intrinsics: [250", "intrinsics: [-250");
    expected = "the focal length is not positive";
  }
  SECTION("another model") {
    replace_text(mav / "cam0/sensor.yaml", "radial-tangential", "fov");
    expected = "distortion_model: 'fov' is not supported (radial-tangential, plumb_bob";
  }
  SECTION("another image size") {
    replace_text(mav / "cam0/sensor.yaml", "[320, 240]", "[640, 480]");
    replace_text(mav / "cam1/sensor.yaml", "[320, 240]", "[640, 480]");
    expected = "calibrated for 640x480, but the images are 320x240";
  }
  SECTION("times out of order") {
    const std::string third = std::to_string(stamp(2));
    replace_text(mav / "cam0/data.csv", third + ",", std::to_string(stamp(0)) + ",");
    expected = "cam0/data.csv:4: times are not strictly ascending";
  }
  SECTION("a timestamp in seconds") {
    replace_text(mav / "cam0/data.csv", std::to_string(stamp(2)) + ",", "1403636579.8,");
    expected = "cam0/data.csv:4: the timestamp is not a whole number";
  }
  SECTION("no images listed") {
    write_text(mav / "cam1/data.csv", "#timestamp [ns],filename\n");
    expected = "cam1/data.csv: lists no images";
  }
  SECTION("no times in common") {
    std::string list;
    for (int i = 0; i < kFrames; ++i) list += std::to_string(i + 1) + ",x.png\n";
    write_text(mav / "cam1/data.csv", list);
    expected = "no timestamps in common: the least difference is -1.4e+12 ms, the tolerance ";
  }
  SECTION("most images missing") {
    fs::remove_all(mav / "cam1/data");
    expected = "6 of 6 frames lack an image";
  }
  SECTION("a zero quaternion in the truth") {
    write_text(mav / "state_groundtruth_estimate0/data.csv", "# h\n1,0,0,0,0,0,0,0\n");
    expected = "data.csv:2: the quaternion is not of unit length";
  }
  const std::string line = open_complaint(folder.path());
  INFO(expected << "\n" << line);
  CHECK(line.find(expected) != std::string::npos);
}

}  // namespace
}  // namespace hybrid_slam
