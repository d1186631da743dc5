#include "frontend/input/trajectory_file.h"

#include <cmath>
#include <sstream>

#include "test/frontend/input/dataset_writer.h"
#include "test/support/shared_cases.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

// A camera that turns by 0.1 rad and goes 0.1 m between poses; the first stands at 0.3 rad.
constexpr int kPoses = 5;
constexpr std::int64_t kFirstStamp = 1403636579'000'000'000;  // [ns]
constexpr std::int64_t kPeriod = 50'000'000;                  // [ns]

Rigid3d pose(int i) {
  return {
      Eigen::Quaterniond(Eigen::AngleAxisd(0.3 + 0.1 * i, Eigen::Vector3d(1, 2, 3).normalized())),
      Eigen::Vector3d(0.1 * i, 1, -2)};
}

std::string rows(const std::string& order, const std::string& separator, bool nanoseconds,
                 const std::string& rest = "", const std::string& line_end = "\n") {
  std::ostringstream text;
  text.precision(17);
  for (int i = 0; i < kPoses; ++i) {
    const std::int64_t stamp = kFirstStamp + i * kPeriod;
    const Rigid3d p = pose(i);
    const auto q = p.rotation();
    const auto t = p.translation();
    const std::string& s = separator;
    if (nanoseconds) {
      text << stamp;
    } else {
      text << static_cast<double>(stamp) * 1e-9;
    }
    text << s << t.x() << s << t.y() << s << t.z();
    if (order == "wxyz") text << s << q.w();
    text << s << q.x() << s << q.y() << s << q.z();
    if (order == "xyzw") text << s << q.w();
    text << rest << line_end;
  }
  return text.str();
}

void check_poses(const TrajectoryFile& file) {
  REQUIRE(file.poses.size() == kPoses);
  CHECK(file.has_times);
  for (int i = 0; i < kPoses; ++i) {
    const StampedPose& read = file.poses[static_cast<std::size_t>(i)];
    const Rigid3d error = inverse(read.world_from_cam) * pose(i);
    CHECK(read.time == Approx(1403636579 + 0.05 * i).margin(1e-6).epsilon(0));
    CHECK(error.translation().norm() < 1e-9);
    CHECK(Eigen::Quaterniond(error.rotation()).vec().norm() < 1e-9);
  }
}

bool has_warning(const TrajectoryFile& file, const std::string& part) {
  const auto has_part = [&](const std::string& line) {
    return line.find(part) != std::string::npos;
  };
  return std::any_of(file.warnings.begin(), file.warnings.end(), has_part) ||
         std::any_of(file.notes.begin(), file.notes.end(), has_part);
}

TEST_CASE("trajectories are read in whichever order their header says") {
  const TempFolder folder;
  const fs::path path = folder.path() / "a.csv";
  const std::string euroc =
      "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], "
      "q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []";
  const std::string okvis =
      "timestamp, p_WS_W_x, p_WS_W_y, p_WS_W_z, q_WS_x, q_WS_y, q_WS_z, q_WS_w";
  const auto reads = [&](const std::string& text) {
    INFO(text);
    write_text(path, text);
    const TrajectoryFile file = read_trajectory(path);
    check_poses(file);
    return file;
  };
  CHECK(has_warning(reads(euroc + "\n" + rows("wxyz", ",", true)), "nanoseconds"));
  reads(okvis + "\n" + rows("xyzw", ",", true));
  reads("# timestamp tx ty tz qx qy qz qw\n" + rows("xyzw", " ", false));
  reads("timestamp tx ty tz qw qx qy qz\n" + rows("wxyz", " ", false));
  reads("\"t\",\"x\",\"y\",\"z\",\"q.w\",\"q.x\",\"q.y\",\"q.z\"\n" + rows("wxyz", ", ", false));
  reads(
      "# one comment\n# t position.x position.y position.z orientation.x orientation.y "
      "orientation.z orientation.w\n" +
      rows("xyzw", ",", true));
  reads(euroc + "\r\n" + rows("wxyz", ",", true, ",", "\r\n"));
}

TEST_CASE("without a header the custom tells the order, or the file is refused") {
  const TempFolder folder;
  const fs::path path = folder.path() / "a.txt";
  const auto read = [&](const std::string& text) {
    write_text(path, text);
    return read_trajectory(path);
  };
  check_poses(read(rows("xyzw", " ", false)));
  check_poses(read(rows("xyzw", "\t", false)));
  CHECK(read(rows("xyzw", " ", false)).notes.empty());
  const TrajectoryFile euroc = read(rows("wxyz", ",", true));
  check_poses(euroc);
  CHECK(has_warning(euroc, "quaternions read as w x y z"));
  CHECK(has_warning(euroc, "times read as nanoseconds"));
  check_poses(read(rows("wxyz", ",", true, ",1,2,3,0.1,0.2,0.3,0,0,0")));  // EuRoC's 17
  // Blanks, whole nanoseconds: nobody's custom.
  write_text(path, rows("wxyz", " ", true));
  CHECK(complaint([&] { read_trajectory(path); }).find(":1: the quaternions may be") !=
        std::string::npos);
  check_poses(read_trajectory(path, QuaternionOrder::kWxyz));
  // ORB-SLAM3 writes a fraction.
  const std::string orbslam =
      "1403636579000000000.000000 0 1 -2 0 0 0 1\n1403636579050000128.000000 0 1 -2 0 0 0.1 "
      "0.994987\n";
  const TrajectoryFile keyframes = read(orbslam);
  REQUIRE(keyframes.poses.size() == 2);
  CHECK(keyframes.poses[1].world_from_cam.rotation().w() == Approx(0.994987));
  CHECK(has_warning(keyframes, "x y z w"));
  // A first pose without rotation contradicts the custom.
  write_text(path, "1403636579000000000,0,1,-2,0,0,0,1\n");
  CHECK(complaint([&] { read_trajectory(path); }).find("the quaternions may be") !=
        std::string::npos);
}

TEST_CASE("of two poses at one time the later is left out and counted") {
  const TempFolder folder;
  const fs::path path = folder.path() / "a.tum";
  write_text(
      path,
      "0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n1 5 5 5 0 0 0 1\n1 1 2 3 0 0 0 1\n2 1 2 3 0 0 0 1\n");
  const TrajectoryFile file = read_trajectory(path);
  REQUIRE(file.poses.size() == 3);
  CHECK(file.poses[1].world_from_cam.translation() == Eigen::Vector3d(1, 2, 3));
  CHECK(file.poses[2].time == 2);
  CHECK(has_warning(file, "2 of 5 poses have the time of the one before (first: line 3)"));
}

TEST_CASE("byte order marks, UTF-16 and decimal commas of trajectories") {
  const TempFolder folder;
  const fs::path path = folder.path() / "a.tum";
  write_text(path, "\xEF\xBB\xBF" + rows("xyzw", " ", false, "", "\r\n"));
  check_poses(read_trajectory(path));
  const auto refused = [&](const std::string& text, const std::string& expected) {
    write_text(path, text);
    const std::string line = complaint([&] { read_trajectory(path); });
    INFO(line);
    CHECK(line.find(expected) != std::string::npos);
  };
  std::string utf16;
  for (const char c : rows("xyzw", " ", false)) (utf16 += c) += '\0';
  refused("\xFF\xFE" + utf16, "UTF-16");
  refused(utf16, "UTF-16");
  refused(std::string(1, '\0') + utf16.substr(0, utf16.size() - 1), "UTF-16");
  refused("0,0 1,0 2,0 3,0 0,0 0,0 0,0 1,0\n", ":1: decimal commas");
}

TEST_CASE("trajectories of the cases as their users had them") {
  const auto cases = shared_cases("trajectories");
  if (!cases) return;
  const TrajectoryFile truth = read_trajectory(*cases / "truth.tum");
  REQUIRE(truth.poses.size() == 60);
  for (const char* const name : {"tumvi_truth.csv", "nanoseconds.txt", "truth_seconds.tum"}) {
    INFO(name);
    const TrajectoryFile file = read_trajectory(*cases / name);
    REQUIRE(file.poses.size() == 60);
    for (std::size_t i = 0; i < 60; ++i) {
      const Rigid3d error = inverse(file.poses[i].world_from_cam) * truth.poses[i].world_from_cam;
      CHECK(file.poses[i].time == Approx(truth.poses[i].time).margin(1e-6).epsilon(0));
      CHECK(error.translation().norm() < 1e-5);
      CHECK(Eigen::Quaterniond(error.rotation()).vec().norm() < 1e-5);
    }
  }
  for (const char* const name : {"bom.tum", "header_word.tum", "estimate_nanoseconds.txt"}) {
    INFO(name);
    CHECK(read_trajectory(*cases / name).poses.size() == 60);
  }
  for (const char* const name : {"duplicate_line.tum", "same_time_two_poses.tum"}) {
    INFO(name);
    const TrajectoryFile file = read_trajectory(*cases / name);
    CHECK(file.poses.size() == 60);
    CHECK(has_warning(file, "1 of 61 poses"));
  }
}

}  // namespace
}  // namespace hybrid_slam
