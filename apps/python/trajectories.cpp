#include <sstream>

#include "apps/io/trajectory.h"
#include "apps/python/conversions.h"
#include "frontend/input/trajectory_file.h"

namespace hybrid_slam::python {
namespace {

const std::map<std::string, TrajectoryAlignment> kAlignments{{"none", TrajectoryAlignment::kNone},
                                                             {"se3", TrajectoryAlignment::kSe3},
                                                             {"sim3", TrajectoryAlignment::kSim3}};

Path make_path(const std::vector<double>& times,
               const py::array_t<double, py::array::c_style | py::array::forcecast>& poses) {
  const std::vector<Rigid3d> rigids = to_rigids(poses);
  if (times.size() != rigids.size())
    throw std::invalid_argument("there are as many times as poses");
  Path path;
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (i > 0 && !(times[i] > times[i - 1]))
      throw std::invalid_argument("times do not ascend at pose " + std::to_string(i));
    path.poses.push_back({times[i], rigids[i]});
  }
  return path;
}

std::vector<PosePair> pairs_of(const Path& estimate, const Path& truth, double max_difference) {
  return associate(estimate.poses, truth.poses, max_difference);
}

AbsoluteError ate(const Path& estimate, const Path& truth, const std::string& align,
                  double max_difference) {
  const auto alignment = to_enum("align", kAlignments, align);
  const auto pairs = pairs_of(estimate, truth, max_difference);
  const auto error = absolute_error(pairs, alignment);
  if (!error)
    throw std::invalid_argument(std::to_string(pairs.size()) +
                                " pairs of poses cannot be aligned by " + align);
  return *error;
}

RelativeError rpe(const Path& estimate, const Path& truth, std::size_t delta,
                  double max_difference) {
  const auto pairs = pairs_of(estimate, truth, max_difference);
  const auto error = relative_error(pairs, delta, 1);
  if (!error)
    throw std::invalid_argument("there are " + std::to_string(pairs.size()) +
                                " pairs of poses, and delta is " + std::to_string(delta));
  return *error;
}

}  // namespace

void bind_trajectories(py::module_& module) {
  py::class_<Path>(module, "Trajectory", "Poses of a camera in the world, ascending in time.")
      .def(py::init(&make_path), py::arg("times"), py::arg("world_from_cam"),
           "times (N,) [s], poses (N, 4, 4) [m].")
      .def_property_readonly(
          "times",
          [](const Path& path) {
            Eigen::VectorXd times(static_cast<Eigen::Index>(path.poses.size()));
            for (std::size_t i = 0; i < path.poses.size(); ++i)
              times[static_cast<Eigen::Index>(i)] = path.poses[i].time;
            return times;
          },
          "(N,) [s]")
      .def_property_readonly(
          "world_from_cam",
          [](const Path& path) {
            std::vector<Rigid3d> poses;
            for (const StampedPose& pose : path.poses) poses.push_back(pose.world_from_cam);
            return to_array(poses);
          },
          "(N, 4, 4) [m]")
      .def_property_readonly(
          "positions",
          [](const Path& path) {
            Points3 positions(static_cast<Eigen::Index>(path.poses.size()), 3);
            for (std::size_t i = 0; i < path.poses.size(); ++i) {
              positions.row(static_cast<Eigen::Index>(i)) =
                  path.poses[i].world_from_cam.translation().transpose();
            }
            return positions;
          },
          "(N, 3) of the camera in the world [m]")
      .def("__len__", [](const Path& path) { return path.poses.size(); })
      .def(
          "write_tum",
          [](const Path& path, const std::string& file) { write_tum(file, path.poses); },
          py::arg("path"), "A line per pose: t tx ty tz qx qy qz qw. Raises OutputError.");
  py::class_<ErrorStatistics>(module, "ErrorStatistics")
      .def_readonly("count", &ErrorStatistics::count)
      .def_readonly("rmse", &ErrorStatistics::rmse)
      .def_readonly("mean", &ErrorStatistics::mean)
      .def_readonly("median", &ErrorStatistics::median)
      .def_readonly("max", &ErrorStatistics::max)
      .def("__repr__", [](const ErrorStatistics& e) {
        std::ostringstream text;
        text << "<hybrid_slam.ErrorStatistics rmse=" << e.rmse << " mean=" << e.mean
             << " median=" << e.median << " max=" << e.max << " count=" << e.count << ">";
        return text.str();
      });
  py::class_<AbsoluteError>(module, "AbsoluteError")
      .def_readonly("position", &AbsoluteError::position, "[m]")
      .def_readonly("estimated_length", &AbsoluteError::estimated_length, "[m]")
      .def_readonly("true_length", &AbsoluteError::true_length, "[m]")
      .def_property_readonly("scale",
                             [](const AbsoluteError& e) { return e.truth_from_estimate.scale(); })
      .def_property_readonly(
          "truth_from_estimate",
          [](const AbsoluteError& e) {
            Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
            m.topLeftCorner<3, 3>() =
                e.truth_from_estimate.scale() * e.truth_from_estimate.rotation().toRotationMatrix();
            m.topRightCorner<3, 1>() = e.truth_from_estimate.translation();
            return m;
          },
          "(4, 4) the alignment, scale included.");
  py::class_<RelativeError>(module, "RelativeError")
      .def_readonly("translation", &RelativeError::translation, "[m]")
      .def_readonly("rotation", &RelativeError::rotation, "[rad]");
  module.def(
      "read_trajectory", [](const std::string& path) { return Path{read_trajectory(path).poses}; },
      py::arg("path"),
      "A trajectory in TUM's, EuRoC's or KITTI's text (without times: 0, 1, 2, ... s). Raises "
      "InputError.");
  module.def(
      "ate", &ate, py::arg("estimate"), py::arg("truth"), py::kw_only(), py::arg("align") = "se3",
      py::arg("max_difference") = 0.02,
      "Absolute trajectory error after the best alignment (none, se3 or sim3) of poses at most "
      "`max_difference` [s] apart.");
  module.def("rpe", &rpe, py::arg("estimate"), py::arg("truth"), py::kw_only(),
             py::arg("delta") = 1, py::arg("max_difference") = 0.02,
             "Relative pose error: of the motions over `delta` pairs.");
}

}  // namespace hybrid_slam::python
