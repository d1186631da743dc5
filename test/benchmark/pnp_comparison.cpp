// MLPnP against OpenGV's EPnP and UPnP, each followed by the same refinement, and OpenCV's
// solvePnP, in one thread: a table of medians over many scenes, rotation error [deg] / translation
// error [cm] / time [us], and the share of results that are off by more than 6 degrees. One
// argument: the number of scenes (default 500).
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <iomanip>
#include <iostream>
#include <limits>
#include <sstream>
#include <string>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opengv/absolute_pose/CentralAbsoluteAdapter.hpp>
#include <opengv/absolute_pose/methods.hpp>

#include "frontend/pose/mlpnp.h"
#include "frontend/pose/pnp_ransac.h"
#include "test/frontend/pose/pnp_scene.h"
#include "test/frontend/pose/pose_scene.h"

namespace hybrid_slam {
namespace {

using pose_scene::PnpScene;
using pose_scene::PnpSceneOptions;
using Pose = std::optional<Rigid3d>;

// What a solver is given, in its own terms, made before the clock starts.
struct Problem {
  explicit Problem(const PnpScene& scene)
      : truth(scene.truth),
        camera(scene.camera),
        observations(scene.observations),
        ours(bearing_observations(scene.camera, scene.observations)) {
    for (const BearingObservation& o : ours) {
      bearings.push_back(o.bearing);
      points.push_back(o.point_in_world);
    }
    const auto* pinhole = std::get_if<Calibrated<Pinhole>>(&scene.camera);
    if (pinhole == nullptr) return;
    const auto& p = pinhole->params;
    camera_matrix = (cv::Mat_<double>(3, 3) << p[0], 0, p[2], 0, p[1], p[3], 0, 0, 1);
    for (const PoseObservation& o : scene.observations) {
      const Eigen::Vector3d& x = o.point_in_world;
      cv_points.emplace_back(x.x(), x.y(), x.z());
      cv_pixels.emplace_back(o.measurement.x(), o.measurement.y());
    }
  }

  Rigid3d truth;
  Camera camera;
  std::vector<PoseObservation> observations;
  std::vector<BearingObservation> ours;
  opengv::bearingVectors_t bearings;
  opengv::points_t points;
  cv::Mat camera_matrix;
  std::vector<cv::Point3d> cv_points;
  std::vector<cv::Point2d> cv_pixels;
};

Rigid3d from_opengv(const opengv::transformation_t& world_from_cam) {
  return inverse(Rigid3d(Eigen::Quaterniond(Eigen::Matrix3d(world_from_cam.leftCols<3>())),
                         world_from_cam.col(3)));
}

Pose mlpnp(const Problem& problem) { return solve_mlpnp(problem.ours); }

Pose epnp(const Problem& problem) {
  opengv::absolute_pose::CentralAbsoluteAdapter adapter(problem.bearings, problem.points);
  const auto pose = opengv::absolute_pose::epnp(adapter);
  if (!pose.allFinite()) return std::nullopt;
  return refine_on_bearings(problem.ours, from_opengv(pose));
}

Pose upnp(const Problem& problem) {
  opengv::absolute_pose::CentralAbsoluteAdapter adapter(problem.bearings, problem.points);
  Pose best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (const auto& pose : opengv::absolute_pose::upnp(adapter)) {
    if (!pose.allFinite()) continue;
    const Rigid3d candidate = from_opengv(pose);
    const double cost = bearing_cost(problem.ours, candidate);
    if (cost >= best_cost) continue;
    best_cost = cost;
    best = candidate;
  }
  return best ? refine_on_bearings(problem.ours, *best) : std::nullopt;
}

Pose opencv(const Problem& problem, int method) {
  cv::Mat rotation, translation, matrix;
  try {
    if (!cv::solvePnP(problem.cv_points, problem.cv_pixels, problem.camera_matrix, cv::noArray(),
                      rotation, translation, false, method)) {
      return std::nullopt;
    }
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
  if (method == cv::SOLVEPNP_EPNP || method == cv::SOLVEPNP_SQPNP) {
    cv::solvePnPRefineLM(problem.cv_points, problem.cv_pixels, problem.camera_matrix, cv::noArray(),
                         rotation, translation);
  }
  cv::Rodrigues(rotation, matrix);
  Eigen::Matrix3d r;
  Eigen::Vector3d t;
  for (int i = 0; i < 3; ++i) {
    t[i] = translation.at<double>(i);
    for (int j = 0; j < 3; ++j) r(i, j) = matrix.at<double>(i, j);
  }
  if (!r.allFinite() || !t.allFinite()) return std::nullopt;
  return Rigid3d(Eigen::Quaterniond(r), t);
}

Pose opencv_iterative(const Problem& problem) { return opencv(problem, cv::SOLVEPNP_ITERATIVE); }
Pose opencv_epnp(const Problem& problem) { return opencv(problem, cv::SOLVEPNP_EPNP); }
Pose opencv_sqpnp(const Problem& problem) { return opencv(problem, cv::SOLVEPNP_SQPNP); }

Pose ransac(const Problem& problem) {
  const auto found = solve_pnp_ransac(problem.ours, {.min_inliers = 6});
  return found ? Pose(found->cam_from_world) : std::nullopt;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

struct Measured {
  std::vector<double> rotation;     // [deg]
  std::vector<double> translation;  // [cm]
  std::vector<double> time;         // [us], the best of three
  int failed = 0;                   // no pose, or one off by more than 6 deg

  void enter(const Problem& problem, const Rigid3d* pose) {
    constexpr double kNone = std::numeric_limits<double>::infinity();
    rotation.push_back(pose == nullptr ? kNone
                                       : 180 / std::numbers::pi *
                                             pose_scene::rotation_error(*pose, problem.truth));
    translation.push_back(
        pose == nullptr ? kNone : 100 * pose_scene::translation_error(*pose, problem.truth));
    failed += !(rotation.back() < 6);
  }
};

// A cell of the table.
std::string measure(const std::vector<Problem>& problems,
                    const std::function<Pose(const Problem&)>& solve) {
  Measured measured;
  for (const Problem& problem : problems) {
    double best = std::numeric_limits<double>::infinity();
    for (int repeat = 0; repeat < 3; ++repeat) {
      const auto start = std::chrono::steady_clock::now();
      const Pose pose = solve(problem);
      const std::chrono::duration<double, std::micro> taken =
          std::chrono::steady_clock::now() - start;
      best = std::min(best, taken.count());
      if (repeat == 0) measured.enter(problem, pose ? &*pose : nullptr);
    }
    measured.time.push_back(best);
  }
  std::ostringstream cell;
  cell << std::fixed << std::setprecision(3) << median(measured.rotation) << "/"
       << median(measured.translation) << "/" << std::setprecision(0) << median(measured.time);
  const double failed = 100.0 * measured.failed / static_cast<double>(problems.size());
  if (failed > 0) cell << std::setprecision(1) << " (" << failed << " %)";
  return cell.str();
}

void compare(const std::string& name, PnpSceneOptions options, int scenes) {
  std::vector<Problem> problems;
  for (options.seed = 0; options.seed < static_cast<std::uint64_t>(scenes); ++options.seed) {
    problems.emplace_back(make_pnp_scene(options));
  }
  std::cout << "| " << name << ", " << options.count;
  if (options.outlier_share > 0) {
    std::cout << " | " << measure(problems, ransac) << " | | | | | |\n" << std::flush;
    return;
  }
  for (const auto& solve : {mlpnp, epnp, upnp}) std::cout << " | " << measure(problems, solve);
  for (const auto& solve : {opencv_iterative, opencv_epnp, opencv_sqpnp}) {
    std::cout << " | ";
    if (std::holds_alternative<Calibrated<Pinhole>>(options.camera)) {
      std::cout << measure(problems, solve);
    }
  }
  std::cout << " |\n" << std::flush;
}

void run(int scenes) {
  const Camera pinhole = pose_scene::pinhole();
  const Camera fisheye = pose_scene::fisheye();
  std::cout << "| scene, points | MLPnP | EPnP, refined | UPnP, refined | OpenCV iterative "
               "| OpenCV EPnP, LM | OpenCV SQPnP, LM |\n|---|---|---|---|---|---|---|\n";
  for (const int count : {6, 20, 100, 1000}) {
    compare("pinhole", {.camera = pinhole, .count = count}, scenes);
    compare("pinhole, plane", {.camera = pinhole, .count = count, .planar = true}, scenes);
    compare("fisheye", {.camera = fisheye, .count = count}, scenes);
    compare("fisheye, plane", {.camera = fisheye, .count = count, .planar = true}, scenes);
  }
  for (const int count : {6, 50}) {
    compare("fisheye, all beyond 90 deg",
            {.camera = fisheye, .count = count, .min_angle = std::numbers::pi / 2}, scenes);
    compare("pinhole, 0.5 to 2 px",
            {.camera = pinhole, .count = count, .sigma = 0.5, .max_sigma = 2}, scenes);
    compare("pinhole, plane with 0.4 m of relief",
            {.camera = pinhole, .count = count, .planar = true, .thickness = 0.2}, scenes);
    compare("pinhole, 50 to 60 m away",
            {.camera = pinhole, .count = count, .min_distance = 50, .max_distance = 60}, scenes);
  }
  for (const int count : {100, 500}) {
    compare("pinhole, 50 % outliers", {.camera = pinhole, .count = count, .outlier_share = 0.5},
            scenes);
    compare("fisheye, 50 % outliers", {.camera = fisheye, .count = count, .outlier_share = 0.5},
            scenes);
  }
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  hybrid_slam::run(argc > 1 ? std::atoi(argv[1]) : 500);
}
