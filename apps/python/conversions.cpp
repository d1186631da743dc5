#include "apps/python/conversions.h"

#include <cstring>
#include <memory>
#include <stdexcept>

namespace hybrid_slam::python {

Eigen::Matrix4d to_matrix(const Rigid3d& b_from_a) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = b_from_a.rotation().toRotationMatrix();
  m.topRightCorner<3, 1>() = b_from_a.translation();
  return m;
}

Rigid3d to_rigid(const Eigen::Matrix4d& b_from_a) {
  const Eigen::Matrix3d rotation = b_from_a.topLeftCorner<3, 3>();
  const bool rigid =
      b_from_a.allFinite() &&
      (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <
          1e-6 &&
      rotation.determinant() > 0 && b_from_a.row(3) == Eigen::RowVector4d(0, 0, 0, 1);
  if (!rigid)
    throw std::invalid_argument(
        "not a rigid transform: rotation, translation and a last row 0 0 0 1");
  return {Eigen::Quaterniond(rotation), b_from_a.topRightCorner<3, 1>()};
}

py::array_t<double> to_array(const std::vector<Rigid3d>& poses) {
  py::array_t<double> array(
      {static_cast<py::ssize_t>(poses.size()), py::ssize_t{4}, py::ssize_t{4}});
  double* out = array.mutable_data();
  for (const Rigid3d& pose : poses) {
    Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(out);
    matrix = to_matrix(pose);
    out += 16;
  }
  return array;
}

std::vector<Rigid3d> to_rigids(
    const py::array_t<double, py::array::c_style | py::array::forcecast>& poses) {
  if (poses.ndim() != 3 || poses.shape(1) != 4 || poses.shape(2) != 4) {
    throw std::invalid_argument("poses are an array of shape (N, 4, 4)");
  }
  std::vector<Rigid3d> rigids;
  const double* in = poses.data();
  for (py::ssize_t i = 0; i < poses.shape(0); ++i, in += 16) {
    rigids.push_back(to_rigid(Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(in)));
  }
  return rigids;
}

GrayImage to_image(const py::array& array, const char* name) {
  if (!py::isinstance<py::array_t<std::uint8_t>>(array) || array.ndim() != 2) {
    throw std::invalid_argument(
        std::string(name) + " is no grey image: an array of uint8 and of shape (height, width)");
  }
  GrayImage image;
  image.height = static_cast<int>(array.shape(0));
  image.width = static_cast<int>(array.shape(1));
  image.pixels.resize(static_cast<std::size_t>(array.size()));
  const auto* first = static_cast<const std::uint8_t*>(array.data());
  if ((array.flags() & py::array::c_style) != 0) {
    if (!image.pixels.empty()) std::memcpy(image.pixels.data(), first, image.pixels.size());
    return image;
  }
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x)
      image.row(y)[x] = first[y * array.strides(0) + x * array.strides(1)];
  }
  return image;
}

py::array_t<std::uint8_t> to_array(GrayImage image) {
  auto owner = std::make_unique<std::vector<std::uint8_t>>(std::move(image.pixels));
  const std::uint8_t* pixels = owner->data();
  const py::capsule capsule(owner.release(),
                            [](void* p) { delete static_cast<std::vector<std::uint8_t>*>(p); });
  return py::array_t<std::uint8_t>({image.height, image.width}, pixels, capsule);
}

}  // namespace hybrid_slam::python
