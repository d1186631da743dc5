// Whether poses are off by what their covariances say: reads what runs of hybrid_slam wrote
// (frames.csv, fisheye_in_left.csv) and the truth of the sequences that they are of.
//   pose_covariance RUN_FOLDER...
// Says the normalised error squared (NEES) per degree of freedom, of which 1 is the mean where the
// covariances are right, at three moments of each run: errors of successive frames have the map's
// in common. And the frames in state `map` that are farther off than 3 sigma and a centimetre.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/report/result_table.h"
#include "cameras/geometry/uncertain_motion.h"
#include "frontend/input/image_sequence.h"
#include "frontend/input/trajectory_file.h"

namespace hybrid_slam {
namespace {

constexpr std::array kAxes = {"x", "y", "z", "rx", "ry", "rz"};
constexpr std::array kParts = {"a third", "two thirds", "the end"};
constexpr std::string_view kOrigin = "0";  // the map's first keyframe
constexpr double kSameTime = 1e-3;         // [s]

using Poses = std::vector<StampedPose>;
using Errors = std::map<std::size_t, double>;  // NEES per degree of freedom, by the row of a table

Rigid3d pose_at(const ResultTable& table, std::size_t row) {
  const auto number = [&](const char* column) { return table.number(row, column); };
  return {Eigen::Quaterniond(number("qw"), number("qx"), number("qy"), number("qz")).normalized(),
          Eigen::Vector3d(number("tx"), number("ty"), number("tz"))};
}

// ROS' order and axes, as docs/conventions.md has it.
Matrix6d covariance_at(const ResultTable& table, std::size_t row) {
  Matrix6d covariance;
  for (Eigen::Index i = 0; i < 6; ++i) {
    for (Eigen::Index j = i; j < 6; ++j) {
      const std::string column = std::string("cov_") + kAxes[static_cast<std::size_t>(i)] + "_" +
                                 kAxes[static_cast<std::size_t>(j)];
      covariance(i, j) = covariance(j, i) = table.number(row, column);
    }
  }
  return covariance;
}

// Position along the base's axes, then the turn about them, from the estimate to the truth.
Vector6d ros_error(const Rigid3d& estimate, const Rigid3d& truth) {
  Vector6d error;
  error << truth.translation() - estimate.translation(),
      so3_log(truth.rotation() * estimate.rotation().conjugate());
  return error;
}

const StampedPose* find(const Poses& poses, double time) {
  const auto at = std::lower_bound(poses.begin(), poses.end(), time - kSameTime,
                                   [](const StampedPose& pose, double t) { return pose.time < t; });
  return at != poses.end() && at->time < time + kSameTime ? &*at : nullptr;
}

double nees(const ResultTable& table, std::size_t row, const Rigid3d& truth) {
  return squared_mahalanobis(ros_error(pose_at(table, row), truth), covariance_at(table, row)) / 6;
}

// A survey's truth has no rotation in its dataset's own format; the renderer's has it beside.
Poses survey_truth(const nlohmann::json& summary) {
  const std::filesystem::path dataset = summary.at("dataset").get<std::string>();
  const auto inside = dataset / summary.at("sequence").get<std::string>();
  return read_trajectory((exists(inside) ? inside : dataset) / "gt_left_tum.txt").poses;
}

// What a run says, and what is true.
class Run {
 public:
  explicit Run(const std::filesystem::path& folder) : frames_(folder / "frames.csv") {
    const auto summary = nlohmann::json::parse(std::ifstream(folder / "summary.json"));
    const auto sequence = open_sequence(summary.at("dataset"), SequenceLayout::kAuto,
                                        summary.at("sequence"), SequenceCameras::kAuto);
    left_ = sequence->info().truth_has_rotation ? sequence->info().truth : survey_truth(summary);
    fisheye_ = sequence->info().fisheye_truth;
    if (std::filesystem::exists(folder / "fisheye_in_left.csv")) {
      in_left_ = ResultTable(folder / "fisheye_in_left.csv");
    }
  }

  // Of the frames whose covariance is against the map's origin. In that itself it is zero.
  Errors of_camera(const std::string& camera) const {
    const Poses& truth = camera == "stereo" ? left_ : fisheye_;
    Errors errors;
    for (std::size_t row = 0; row < frames_.size(); ++row) {
      const StampedPose* true_pose = find(truth, frames_.number(row, "time"));
      const bool known = frames_.number(row, "sigma_position") > 0 &&
                         frames_.text(row, "covariance_base") == kOrigin;
      if (frames_.text(row, "camera") != camera || !true_pose || !known) continue;
      errors[row] = nees(frames_, row, map_from_truth() * true_pose->world_from_cam);
    }
    return errors;
  }

  Errors of_fisheye_in_left() const {
    Errors errors;
    for (std::size_t row = 0; row < in_left_.size(); ++row) {
      const StampedPose* left = find(left_, in_left_.number(row, "time"));
      const StampedPose* fisheye = find(fisheye_, in_left_.number(row, "time"));
      if (!left || !fisheye) continue;
      errors[row] = nees(in_left_, row, inverse(left->world_from_cam) * fisheye->world_from_cam);
    }
    return errors;
  }

  struct Count {
    int map = 0;  // frames in this state, and those of them that are far off
    int far = 0;
  };
  Count count_far() const {
    Count count;
    for (std::size_t row = 0; row < frames_.size(); ++row) {
      const Poses& truth = frames_.text(row, "camera") == "stereo" ? left_ : fisheye_;
      const StampedPose* true_pose = find(truth, frames_.number(row, "time"));
      // Where another component lies is not known, and it does not say that it was.
      const bool placed = frames_.text(row, "component") == kOrigin;
      if (frames_.text(row, "state") != "map" || !placed || !true_pose) continue;
      const Rigid3d in_map = map_from_truth() * true_pose->world_from_cam;
      const double off = (pose_at(frames_, row).translation() - in_map.translation()).norm();
      ++count.map;
      count.far += off > 0.01 && off > 3 * frames_.number(row, "sigma_position") ? 1 : 0;
    }
    return count;
  }

 private:
  Rigid3d map_from_truth() const {
    for (std::size_t row = 0; row < frames_.size(); ++row) {
      const StampedPose* truth = find(left_, frames_.number(row, "time"));
      if (frames_.text(row, "camera") != "stereo" || frames_.text(row, "tx").empty() || !truth) {
        continue;
      }
      return pose_at(frames_, row) * inverse(truth->world_from_cam);
    }
    throw InputError("no pose of the left camera that has a truth");
  }

  ResultTable frames_, in_left_;
  Poses left_, fisheye_;
};

// At a third, two thirds and the end of a run; its mean over all last, as a help to the eye.
void print_line(const std::string& folder, const char* what, const Errors& errors) {
  if (errors.empty()) return;
  std::printf("%s, %s:", folder.c_str(), what);
  for (std::size_t part = 1; part <= kParts.size(); ++part) {
    std::printf(" %6.3f", std::next(errors.begin(), static_cast<std::ptrdiff_t>(
                                                        part * errors.size() / kParts.size() - 1))
                              ->second);
  }
  std::printf("\n");
}

void add(std::array<std::vector<double>, kParts.size()>& values, const Errors& errors) {
  if (errors.size() < kParts.size()) return;
  for (std::size_t part = 0; part < kParts.size(); ++part) {
    const auto at = static_cast<std::ptrdiff_t>((part + 1) * errors.size() / kParts.size() - 1);
    values[part].push_back(std::next(errors.begin(), at)->second);
  }
}

int check(const std::vector<std::string>& folders) {
  constexpr std::array kPoses = {"stereo", "fisheye", "fisheye in left"};
  std::array<std::array<std::vector<double>, kParts.size()>, kPoses.size()> values;
  Run::Count all;
  for (const std::string& folder : folders) {
    const Run run(folder);
    const std::array errors = {run.of_camera(kPoses[0]), run.of_camera(kPoses[1]),
                               run.of_fisheye_in_left()};
    for (std::size_t pose = 0; pose < kPoses.size(); ++pose) {
      print_line(folder, kPoses[pose], errors[pose]);
      add(values[pose], errors[pose]);
    }
    const Run::Count count = run.count_far();
    all.map += count.map;
    all.far += count.far;
    if (count.far > 0) std::printf("%s: %d frames far off\n", folder.c_str(), count.far);
  }
  for (std::size_t pose = 0; pose < kPoses.size(); ++pose) {
    for (std::size_t part = 0; part < kParts.size(); ++part) {
      const std::vector<double>& of = values[pose][part];
      if (of.empty()) continue;
      std::printf(
          "%s at %s: mean NEES %.3f per degree of freedom (%zu runs)\n", kPoses[pose], kParts[part],
          std::accumulate(of.begin(), of.end(), 0.0) / static_cast<double>(of.size()), of.size());
    }
  }
  std::printf("%d of %d frames in state map are off by more than 3 sigma and 1 cm\n", all.far,
              all.map);
  return 0;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: pose_covariance RUN_FOLDER...\n");
    return 2;
  }
  try {
    return hybrid_slam::check({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "pose_covariance: %s\n", error.what());
    return 3;
  }
}
