#pragma once

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"
#include "frontend/features/image.h"
#include "frontend/input/image_sequence.h"

// What Python sees of our values: numpy arrays, names for enumerators.

namespace hybrid_slam::python {

namespace py = pybind11;

using Points3 = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using Points2 = Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>;
using Points3In = Eigen::Ref<const Points3>;
using Points2In = Eigen::Ref<const Points2>;

// b_from_a as 4x4.
Eigen::Matrix4d to_matrix(const Rigid3d& b_from_a);

// Throws std::invalid_argument unless it is a rigid transform: rows of length 1 and at right angles
// up to 1e-6, the last one 0 0 0 1. What is off is rounded away.
Rigid3d to_rigid(const Eigen::Matrix4d& b_from_a);

// Poses one after the other, (N, 4, 4).
py::array_t<double> to_array(const std::vector<Rigid3d>& poses);
std::vector<Rigid3d> to_rigids(
    const py::array_t<double, py::array::c_style | py::array::forcecast>& poses);

// The pixels of a (height, width) uint8 array, which are copied once, row by row where they are not
// contiguous. Throws std::invalid_argument, naming it, for other arrays.
GrayImage to_image(const py::array& array, const char* name);

// An array that owns the image's pixels: they are not copied.
py::array_t<std::uint8_t> to_array(GrayImage image);

// The enumerator of a name; throws std::invalid_argument with the names that there are.
template <typename Enum>
Enum to_enum(const char* what, const std::map<std::string, Enum>& names, const std::string& name) {
  const auto found = names.find(name);
  if (found != names.end()) return found->second;
  std::string known;
  for (const auto& [each, value] : names) known += (known.empty() ? "" : ", ") + each;
  throw std::invalid_argument(std::string(what) + " \"" + name + "\" is none of: " + known);
}

// A camera in Python, of any model.
struct AnyCamera {
  Camera camera;
};

template <typename Model>
const Calibrated<Model>& camera_of(const AnyCamera& camera, const char* what) {
  const auto* found = std::get_if<Calibrated<Model>>(&camera.camera);
  if (found == nullptr) {
    throw std::invalid_argument(std::string(what) + " is a " +
                                std::string(model_name(camera.camera)) + " camera, not a " +
                                std::string(Model::kName) + " one");
  }
  return *found;
}

// An estimated or true path in Python.
struct Path {
  std::vector<StampedPose> poses;  // ascending in time
};

void bind_cameras(py::module_& module);
void bind_input(py::module_& module);
void bind_session(py::module_& module);
void bind_map(py::module_& module);
void bind_trajectories(py::module_& module);
void bind_graph(py::module_& module);

}  // namespace hybrid_slam::python
