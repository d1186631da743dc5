#include "frontend/pose/rigid_alignment.h"

#include <stdexcept>

#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace hybrid_slam {
namespace {

// Spread across the main direction, relative to the spread along it, below which the points count
// as lying on one line. In squared lengths: one millionth of the extent.
constexpr double kCollinear = 1e-12;

struct Moments {
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_b = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // sum of b a^T about the means
  double spread_a = 0;                                   // sum of |a|^2 about the mean
};

Moments moments(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b) {
  Moments m;
  const double n = static_cast<double>(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    m.mean_a += a[i] / n;
    m.mean_b += b[i] / n;
  }
  for (std::size_t i = 0; i < a.size(); ++i) {
    m.covariance += (b[i] - m.mean_b) * (a[i] - m.mean_a).transpose();
    m.spread_a += (a[i] - m.mean_a).squaredNorm();
  }
  return m;
}

struct Alignment {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d mean_a;
  Eigen::Vector3d mean_b;
  double scale;
};

std::optional<Alignment> align(std::span<const Eigen::Vector3d> a,
                               std::span<const Eigen::Vector3d> b, CollinearPoints collinear) {
  if (a.size() != b.size()) throw std::invalid_argument("align: unequal numbers of points");
  if (a.size() < 3) return std::nullopt;
  const Moments m = moments(a, b);
  if (!m.covariance.allFinite()) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m.covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d& singular = svd.singularValues();
  const bool on_line = !(singular[1] > kCollinear * singular[0]);
  if (on_line && collinear == CollinearPoints::kRefuse) return std::nullopt;
  Eigen::Vector3d signs(1, 1, 1);
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) signs[2] = -1;
  const Eigen::Matrix3d rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  return Alignment{Eigen::Quaterniond(rotation), m.mean_a, m.mean_b,
                   singular.dot(signs) / m.spread_a};
}

}  // namespace

std::optional<Rigid3d> align_rigid(std::span<const Eigen::Vector3d> points_in_a,
                                   std::span<const Eigen::Vector3d> points_in_b,
                                   CollinearPoints collinear) {
  const std::optional<Alignment> found = align(points_in_a, points_in_b, collinear);
  if (!found) return std::nullopt;
  return Rigid3d(found->rotation, found->mean_b - found->rotation * found->mean_a);
}

std::optional<Sim3d> align_similarity(std::span<const Eigen::Vector3d> points_in_a,
                                      std::span<const Eigen::Vector3d> points_in_b,
                                      CollinearPoints collinear) {
  const std::optional<Alignment> found = align(points_in_a, points_in_b, collinear);
  if (!found || !(found->scale > 0)) return std::nullopt;
  const Eigen::Vector3d translation =
      found->mean_b - found->scale * (found->rotation * found->mean_a);
  return Sim3d(found->rotation, translation, found->scale);
}

}  // namespace hybrid_slam
