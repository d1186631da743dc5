#include "frontend/pose/mlpnp.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

namespace hybrid_slam {
namespace {

constexpr std::size_t kMinInSpace = 6;
constexpr std::size_t kMinInPlane = 4;
constexpr double kOnLine = 1e-6;  // second extent of the points over the first
// Third extent over the first. Below, the system for points in space has no single solution; from
// there on to kThin either system may be the better one: both are tried.
constexpr double kInPlane = 1e-5;
constexpr double kThin = 0.1;
constexpr int kNullVectors = 2;
// An optimum that costs more standard deviations above its mean is none that noise explains.
constexpr double kImprobable = 4;

// Where the points lie: their mean, and the axes of their scatter, the longest first.
struct PointFrame {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Matrix3d world_from_axes = Eigen::Matrix3d::Identity();  // a rotation
  Eigen::Vector3d extent = Eigen::Vector3d::Zero();               // rms along the axes [m]
};

std::optional<PointFrame> point_frame(std::span<const BearingObservation> observations) {
  PointFrame frame;
  const double n = static_cast<double>(observations.size());
  for (const BearingObservation& o : observations) frame.center += o.point_in_world / n;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const BearingObservation& o : observations) {
    const Eigen::Vector3d p = o.point_in_world - frame.center;
    scatter += p * p.transpose() / n;
  }
  if (!scatter.allFinite()) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  frame.extent = eigen.eigenvalues().reverse().cwiseMax(0).cwiseSqrt();
  frame.world_from_axes = eigen.eigenvectors().rowwise().reverse();
  if (frame.world_from_axes.determinant() < 0) frame.world_from_axes.col(2) *= -1;
  return frame;
}

// The sum over all observations of |whitening * (A q + t)|^2, q the point in its frame over the
// first extent: a quadratic form in (A, t) whose null vector is the linear solution. t is
// eliminated; what remains is a form in a, the columns of A.
class LinearSystem {
 public:
  LinearSystem(std::span<const BearingObservation> observations, const PointFrame& frame)
      : frame_(frame) {
    Eigen::Matrix<double, 6, 10> sums = Eigen::Matrix<double, 6, 10>::Zero();
    const Eigen::Matrix3d axes_from_world = frame.world_from_axes.transpose() / frame.extent[0];
    for (const BearingObservation& o : observations) {
      const Eigen::Vector3d q = axes_from_world * (o.point_in_world - frame.center);
      const auto& w = o.whitening;
      Eigen::Matrix<double, 6, 1> form;
      form << w.col(0).dot(w.col(0)), w.col(0).dot(w.col(1)), w.col(0).dot(w.col(2)),
          w.col(1).dot(w.col(1)), w.col(1).dot(w.col(2)), w.col(2).dot(w.col(2));
      Eigen::Matrix<double, 10, 1> products;
      products << q[0] * q[0], q[0] * q[1], q[0] * q[2], q[0], q[1] * q[1], q[1] * q[2], q[1],
          q[2] * q[2], q[2], 1;
      sums.noalias() += form * products.transpose();
    }
    eliminate_translation(sums);
  }

  // Poses in which the form is small. If the points lie in space: of the null vector, and of the
  // next ones, since few points with noise leave it uncertain ...
  void append_poses_in_space(std::vector<Rigid3d>* poses) const {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> eigen(form_);
    for (int i = 0; i < kNullVectors; ++i) {
      Eigen::Matrix3d a = Eigen::Map<const Eigen::Matrix3d>(eigen.eigenvectors().col(i).data());
      if (a.determinant() < 0) a = -a;
      poses->push_back(pose(a));
    }
  }

  // ... two, before and behind the camera, if they lie in a plane.
  void append_poses_in_plane(std::vector<Rigid3d>* poses) const {
    const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(form_.topLeftCorner<6, 6>());
    Eigen::Matrix3d a;
    a.leftCols<2>() = Eigen::Map<const Eigen::Matrix<double, 3, 2>>(eigen.eigenvectors().data());
    a.col(2) = a.col(0).cross(a.col(1));
    poses->push_back(pose(a));
    a.leftCols<2>() *= -1;
    poses->push_back(pose(a));
  }

 private:
  void eliminate_translation(const Eigen::Matrix<double, 6, 10>& sums) {
    const auto block = [&](int column) {
      const auto s = sums.col(column);
      return Eigen::Matrix3d{{s[0], s[1], s[2]}, {s[1], s[3], s[4]}, {s[2], s[4], s[5]}};
    };
    Eigen::Matrix<double, 3, 9> mixed;
    mixed << block(3), block(6), block(8);
    translation_of_a_ = -block(9).ldlt().solve(mixed);
    form_ << block(0), block(1), block(2), block(1), block(4), block(5), block(2), block(5),
        block(7);
    form_ += mixed.transpose() * translation_of_a_;
  }

  // The pose with the rotation nearest to A (of positive determinant).
  Rigid3d pose(const Eigen::Matrix3d& a) const {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
    const Eigen::Matrix3d cam_from_world = rotation * frame_.world_from_axes.transpose();
    const Eigen::Vector3d t =
        frame_.extent[0] * (translation_of_a_ * rotation.reshaped<Eigen::ColMajor>());
    return {Eigen::Quaterniond(cam_from_world), t - cam_from_world * frame_.center};
  }

  const PointFrame& frame_;
  Eigen::Matrix<double, 9, 9> form_;
  Eigen::Matrix<double, 3, 9> translation_of_a_;
};

struct Start {
  Rigid3d pose;
  double cost;
};

std::vector<Rigid3d> linear_poses(std::span<const BearingObservation> observations) {
  std::vector<Rigid3d> poses;
  if (observations.size() < kMinInPlane) return poses;
  const std::optional<PointFrame> frame = point_frame(observations);
  if (!frame || !(frame->extent[1] > kOnLine * frame->extent[0])) return poses;
  const double thickness = frame->extent[2] / frame->extent[0];
  const LinearSystem system(observations, *frame);
  if (thickness < kThin) system.append_poses_in_plane(&poses);
  if (thickness > kInPlane && observations.size() >= kMinInSpace) {
    system.append_poses_in_space(&poses);
  }
  return poses;
}

// The largest cost of a true pose, which is distributed as chi2 with as many degrees of freedom.
double largest_cost(std::size_t observations) {
  const double freedom = std::max(1.0, 2.0 * static_cast<double>(observations) - 6);
  return freedom + kImprobable * std::sqrt(2 * freedom);
}

}  // namespace

std::optional<Rigid3d> solve_mlpnp(std::span<const BearingObservation> observations,
                                   const Rigid3d* guess) {
  std::vector<Start> starts;
  for (const Rigid3d& pose : linear_poses(observations))
    starts.push_back({pose, bearing_cost(observations, pose)});
  if (guess != nullptr) starts.push_back({*guess, bearing_cost(observations, *guess)});
  std::stable_sort(starts.begin(), starts.end(),
                   [](const Start& a, const Start& b) { return a.cost < b.cost; });
  std::optional<Rigid3d> best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (const Start& start : starts) {
    const std::optional<Rigid3d> pose = refine_on_bearings(observations, start.pose);
    if (!pose) continue;
    const double cost = bearing_cost(observations, *pose);
    if (cost >= best_cost) continue;
    best = pose;
    best_cost = cost;
    if (cost < largest_cost(observations.size())) break;
  }
  return best;
}

}  // namespace hybrid_slam
