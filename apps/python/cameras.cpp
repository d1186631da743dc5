#include <limits>

#include "apps/python/conversions.h"
#include "cameras/calibration/calibration_file.h"

namespace hybrid_slam::python {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

template <typename Model>
AnyCamera make(const std::array<double, Model::kParamCount>& params, int width, int height) {
  if (width < 1 || height < 1)
    throw std::invalid_argument("a camera's images have a width and a height");
  return {Calibrated<Model>{params, width, height}};
}

Eigen::VectorXd params_of(const AnyCamera& camera) {
  return std::visit(
      [](const auto& c) -> Eigen::VectorXd {
        return Eigen::Map<const Eigen::VectorXd>(c.params.data(),
                                                 static_cast<Eigen::Index>(c.params.size()));
      },
      camera.camera);
}

// A row for each row of `in`: what `one` gives of it, NaN where it gives nothing.
template <int kOut, typename In, typename One>
Eigen::Matrix<double, Eigen::Dynamic, kOut, Eigen::RowMajor> each(const In& in, const One& one) {
  Eigen::Matrix<double, Eigen::Dynamic, kOut, Eigen::RowMajor> out(in.rows(), kOut);
  for (Eigen::Index i = 0; i < in.rows(); ++i) {
    const auto result = one(in.row(i).transpose());
    if (result) {
      out.row(i) = result->transpose();
    } else {
      out.row(i).setConstant(kNan);
    }
  }
  return out;
}

void bind_readers(py::module_& module) {
  py::class_<KalibrCamera>(module, "KalibrCamera", "One camera of a Kalibr camchain.")
      .def_readonly("name", &KalibrCamera::name)
      .def_property_readonly("camera", [](const KalibrCamera& c) { return AnyCamera{c.camera}; })
      .def_readonly("radtan", &KalibrCamera::radtan, "k1, k2, p1, p2 to rectify images by.")
      .def_property_readonly(
          "camera_from_previous",
          [](const KalibrCamera& c) {
            return c.camera_from_previous ? std::optional(to_matrix(*c.camera_from_previous))
                                          : std::nullopt;
          },
          "(4, 4) T_cn_cnm1 [m], or None.")
      .def_property_readonly(
          "camera_from_imu",
          [](const KalibrCamera& c) {
            return c.camera_from_imu ? std::optional(to_matrix(*c.camera_from_imu)) : std::nullopt;
          },
          "(4, 4) T_cam_imu [m], or None.")
      .def_readonly("note", &KalibrCamera::note, "How another lens model was taken; else empty.");
  module.def(
      "read_ros_stereo",
      [](const std::string& left, const std::string& right) {
        return AnyCamera{read_ros_stereo(left, right)};
      },
      py::arg("left"), py::arg("right"),
      "The rectified pair of two ROS camera_calibration files. Raises InputError.");
  module.def("read_kalibr_camchain", &read_kalibr_camchain, py::arg("path"),
             "All cameras of a Kalibr camchain, in order. Raises InputError.");
  module.def(
      "read_fisheye", [](const std::string& path) { return AnyCamera{read_fisheye(path)}; },
      py::arg("path"),
      "A fisheye as Kannala-Brandt from Kalibr, Basalt, ORB-SLAM, stella_vslam, ROS or OpenCV "
      "files. Width and "
      "height are 0 where the file does not name them. Raises InputError.");
}

}  // namespace

void bind_cameras(py::module_& module) {
  py::class_<AnyCamera>(
      module, "Camera",
      "A camera model with its numbers. Axes: x right, y down, z forward [m]; the centre of the "
      "first pixel is (0, 0). It does not change.")
      .def_static(
          "pinhole",
          [](double fx, double fy, double cx, double cy, int width, int height) {
            return make<Pinhole>({fx, fy, cx, cy}, width, height);
          },
          py::arg("fx"), py::arg("fy"), py::arg("cx"), py::arg("cy"), py::arg("width"),
          py::arg("height"), "No distortion; all in pixels.")
      .def_static(
          "rectified_stereo",
          [](double fx, double fy, double cx, double cy, double baseline, int width, int height) {
            return make<RectifiedStereo>({fx, fy, cx, cy, baseline}, width, height);
          },
          py::arg("fx"), py::arg("fy"), py::arg("cx"), py::arg("cy"), py::arg("baseline"),
          py::arg("width"), py::arg("height"),
          "A rectified pair, in the left camera's frame; pixels, and the baseline in metres.")
      .def_static(
          "kannala_brandt",
          [](double fx, double fy, double cx, double cy, double k1, double k2, double k3, double k4,
             int width, int height) {
            return make<KannalaBrandt>({fx, fy, cx, cy, k1, k2, k3, k4}, width, height);
          },
          py::arg("fx"), py::arg("fy"), py::arg("cx"), py::arg("cy"), py::arg("k1"), py::arg("k2"),
          py::arg("k3"), py::arg("k4"), py::arg("width"), py::arg("height"),
          "A fisheye (equidistant, OpenCV's fisheye model).")
      .def_property_readonly("model",
                             [](const AnyCamera& c) { return std::string(model_name(c.camera)); })
      .def_property_readonly("params", &params_of,
                             "(n,) the model's parameters, in the order of its maker.")
      .def_property_readonly(
          "width", [](const AnyCamera& c) { return image_width(c.camera); }, "[px]")
      .def_property_readonly(
          "height", [](const AnyCamera& c) { return image_height(c.camera); }, "[px]")
      .def_property_readonly(
          "focal_length", [](const AnyCamera& c) { return focal_length(c.camera); },
          "[px], the mean where there are two.")
      .def_property_readonly(
          "baseline", [](const AnyCamera& c) { return baseline(c.camera); },
          "[m], 0 unless it is a stereo pair.")
      .def(
          "project",
          [](const AnyCamera& c, const Points3In& points) {
            return each<2>(points, [&](const Eigen::Vector3d& p) { return project(c.camera, p); });
          },
          py::arg("points"),
          "Pixels (N, 2) of points (N, 3) in the camera's frame [m]; NaN where there is none.")
      .def(
          "project_stereo",
          [](const AnyCamera& c, const Points3In& points) {
            return each<3>(points,
                           [&](const Eigen::Vector3d& p) { return project_stereo(c.camera, p); });
          },
          py::arg("points"),
          "(u_left, v, u_right) [px], (N, 3), of points (N, 3) [m]; NaN where there is none.")
      .def(
          "unproject",
          [](const AnyCamera& c, const Points2In& pixels) {
            return each<3>(pixels,
                           [&](const Eigen::Vector2d& p) { return unproject(c.camera, p); });
          },
          py::arg("pixels"), "Unit bearings (N, 3) of pixels (N, 2); NaN where no ray has it.")
      .def(
          "triangulate",
          [](const AnyCamera& c, const Points3In& measurements) {
            return each<3>(measurements, [&](const Eigen::Vector3d& m) {
              return triangulate_stereo(c.camera, m);
            });
          },
          py::arg("measurements"),
          "Points (N, 3) [m] in the left camera of (u_left, v, u_right) [px], (N, 3); NaN without "
          "disparity.")
      .def("__eq__",
           [](const AnyCamera& a, const py::object& b) {
             return py::isinstance<AnyCamera>(b) && a.camera == b.cast<const AnyCamera&>().camera;
           })
      .def("__repr__", [](const AnyCamera& c) {
        return "<hybrid_slam.Camera " + std::string(model_name(c.camera)) + " " +
               std::to_string(image_width(c.camera)) + "x" +
               std::to_string(image_height(c.camera)) + ">";
      });
  bind_readers(module);
}

}  // namespace hybrid_slam::python
