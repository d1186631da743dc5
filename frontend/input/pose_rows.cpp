#include "frontend/input/pose_rows.h"

#include <cmath>

#include <Eigen/LU>

namespace hybrid_slam {

namespace {

constexpr double kMaxRotationError = 1e-2;  // text files carry few digits

}  // namespace

Eigen::Quaterniond checked_rotation(double w, double x, double y, double z,
                                    const std::filesystem::path& path, int line) {
  const Eigen::Quaterniond rotation(w, x, y, z);
  if (!(std::abs(rotation.norm() - 1) < kMaxRotationError)) {
    throw line_error(path, line, "the quaternion is not of unit length");
  }
  return rotation.normalized();
}

Rigid3d kitti_pose(const NumberRow& row, const std::filesystem::path& path) {
  if (row.values.size() != 12) {
    throw line_error(path, row.line,
                     "expected 12 numbers, found " + std::to_string(row.values.size()));
  }
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(row.values.data());
  const Eigen::Matrix3d rotation = matrix.leftCols<3>();
  const double error = (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (!(error < kMaxRotationError) || rotation.determinant() < 0) {
    throw line_error(path, row.line, "the 3x3 part is not a rotation");
  }
  return {Eigen::Quaterniond(rotation), matrix.col(3)};
}

}  // namespace hybrid_slam
