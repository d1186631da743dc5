#include "frontend/odometry/stereo_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "frontend/odometry/stereo_motion_covariance.h"
#include "frontend/pose/damped_gauss_newton.h"
#include "frontend/pose/random_sampler.h"
#include "frontend/pose/rigid_alignment.h"

namespace hybrid_slam {
namespace {

constexpr double kHypothesisConverged = 1e-6;  // step [m, rad]
constexpr GaussNewtonStop kRefinementStop{100, 1e-8};
constexpr int kMaxRefinements = 5;  // inliers are chosen anew before each

class StereoMotionSolver {
 public:
  StereoMotionSolver(const Calibrated<RectifiedStereo>& camera,
                     std::span<const StereoCorrespondence> correspondences,
                     const StereoOdometerOptions& options)
      : params_(camera.params), options_(options) {
    for (std::size_t i = 0; i < correspondences.size(); ++i) {
      add(static_cast<int>(i), camera, correspondences[i]);
    }
    fill_scoring_table();
  }

  std::optional<StereoMotionSolution> solve() {
    if (size() < std::max(3, options_.min_inliers)) return std::nullopt;
    std::optional<Rigid3d> motion = search();
    if (motion) motion = refine(*motion);
    if (!motion) return std::nullopt;
    std::vector<int> inliers = find_inliers(*motion);
    if (static_cast<int>(inliers.size()) < options_.min_inliers) return std::nullopt;
    std::vector<StereoSight> sights;
    for (const int i : inliers) {
      const Point& p = points_[static_cast<std::size_t>(i)];
      sights.push_back(
          {p.in_previous, p.measured, p.squared_weight, p.previous_variance, p.current_variance});
    }
    const std::optional<Matrix6d> covariance =
        stereo_motion_covariance(params_, *motion, sights, options_.inlier_threshold);
    if (!covariance) return std::nullopt;
    StereoMotionSolution solution{*motion, *covariance, std::move(inliers)};
    for (int& i : solution.inliers) i = points_[static_cast<std::size_t>(i)].index;
    return solution;
  }

 private:
  struct Point {
    int index;                    // among the caller's correspondences
    Eigen::Vector3d in_previous;  // triangulated
    Eigen::Vector3d in_current;   // the same; not finite where the disparity allows none
    Eigen::Vector4d measured;     // (u_left, v_left, u_right, v_right) in the current frame
    double squared_weight;
    double previous_variance;
    double current_variance;
  };

  int size() const { return static_cast<int>(points_.size()); }

  void add(int index, const Calibrated<RectifiedStereo>& camera, const StereoCorrespondence& c) {
    if (!c.previous.allFinite() || !c.current.allFinite()) return;
    const auto in_previous = triangulate_stereo(camera, c.previous);
    const auto in_current = triangulate_stereo(camera, c.current.head<3>());
    if (!in_previous || !in_current) return;
    const double cu = std::max(std::abs(params_[2]), 1.0);
    const double weight = 1 / (std::abs(c.current[0] - params_[2]) / cu + 0.05);
    points_.push_back({index, *in_previous, *in_current, c.current, weight * weight,
                       c.previous_sigma * c.previous_sigma, c.current_sigma * c.current_sigma});
  }

  // One row per coordinate in single precision: a hypothesis is scored against all points by
  // vector instructions.
  void fill_scoring_table() {
    table_.resize(size(), 7);
    for (int i = 0; i < size(); ++i) {
      const Point& p = points_[static_cast<std::size_t>(i)];
      table_.row(i) << p.in_previous.cast<float>().transpose().array(),
          p.measured.cast<float>().transpose().array();
    }
  }

  // Sum over all points of the squared distance in the four coordinates, cut off at the threshold.
  float score(const Rigid3d& motion) {
    const Eigen::Matrix3f r = motion.rotation().toRotationMatrix().cast<float>();
    const Eigen::Vector3f t = motion.translation().cast<float>();
    const auto [fx, fy, cx, cy, base] =
        std::array{static_cast<float>(params_[0]), static_cast<float>(params_[1]),
                   static_cast<float>(params_[2]), static_cast<float>(params_[3]),
                   static_cast<float>(params_[4])};
    const auto x = table_.col(0), y = table_.col(1), z = table_.col(2);
    const float limit = static_cast<float>(options_.inlier_threshold * options_.inlier_threshold);
    depth_ = r(2, 0) * x + r(2, 1) * y + r(2, 2) * z + t[2];
    u_ = (r(0, 0) * x + r(0, 1) * y + r(0, 2) * z + t[0]) / depth_ * fx + cx;
    v_ = (r(1, 0) * x + r(1, 1) * y + r(1, 2) * z + t[1]) / depth_ * fy + cy;
    error_ = (u_ - table_.col(3)).square() + (v_ - table_.col(4)).square() +
             (u_ - fx * base / depth_ - table_.col(5)).square() + (v_ - table_.col(6)).square();
    return (depth_ > static_cast<float>(kMinDepth)).select(error_.min(limit), limit).sum();
  }

  std::vector<int> find_inliers(const Rigid3d& motion) const {
    const double limit = options_.inlier_threshold * options_.inlier_threshold;
    std::vector<int> inliers;
    for (int i = 0; i < size(); ++i) {
      const Point& p = points_[static_cast<std::size_t>(i)];
      const Eigen::Vector3d point = motion * p.in_previous;
      Eigen::Vector3d m;
      if (!RectifiedStereo::project(params_.data(), point.data(), m.data())) continue;
      const Eigen::Vector4d residual = Eigen::Vector4d(m[0], m[1], m[2], m[1]) - p.measured;
      if (residual.squaredNorm() <= limit) inliers.push_back(i);
    }
    return inliers;
  }

  // None if one of the points named cannot be projected.
  std::optional<NormalEquations<6>> linearize(const Rigid3d& motion,
                                              std::span<const int> indices) const {
    NormalEquations<6> equations;
    const Eigen::Matrix3d rotation = motion.rotation().toRotationMatrix();
    const Eigen::Vector3d translation = motion.translation();
    for (const int index : indices) {
      const Point& p = points_[static_cast<std::size_t>(index)];
      const Eigen::Vector3d point = rotation * p.in_previous + translation;
      Eigen::Vector3d m;
      Eigen::Matrix<double, 3, 3, Eigen::RowMajor> d_point;
      if (!RectifiedStereo::project_with_jacobians(params_.data(), point.data(), m.data(),
                                                   d_point.data(), nullptr)) {
        return std::nullopt;
      }
      // Both rows are measured, and the model has one: their mean, with twice the weight.
      const double v = 0.5 * (p.measured[1] + p.measured[3]);
      Eigen::Vector3d residual(m[0] - p.measured[0], m[1] - v, m[2] - p.measured[2]);
      residual[1] *= std::numbers::sqrt2;
      d_point.row(1) *= std::numbers::sqrt2;
      equations.add<3>(pose_jacobian<3>(d_point, point), residual, p.squared_weight);
      equations.cost += p.squared_weight * residual.squaredNorm();
    }
    return equations;
  }

  // On the points named. None if it does not converge.
  std::optional<Rigid3d> minimize(const Rigid3d& motion, std::span<const int> indices,
                                  const GaussNewtonStop& stop) const {
    const auto minimum = damped_gauss_newton<6>(
        motion, [&](const Rigid3d& pose) { return linearize(pose, indices); }, left_perturbed,
        stop);
    if (!minimum || !minimum->converged) return std::nullopt;
    return minimum->state;
  }

  // The hypothesis of three points: aligned in closed form, then refined on what was measured.
  std::optional<Rigid3d> hypothesis(const std::array<int, 3>& sample) const {
    std::array<Eigen::Vector3d, 3> previous, current;
    for (std::size_t k = 0; k < 3; ++k) {
      const Point& p = points_[static_cast<std::size_t>(sample[k])];
      previous[k] = p.in_previous;
      current[k] = p.in_current;
    }
    const std::optional<Rigid3d> start = align_rigid(previous, current);
    if (!start) return std::nullopt;
    // Where a full step does not descend, an outlier is among them, hardly ever noise: not damped.
    return minimize(*start, sample,
                    {options_.max_gauss_newton_iterations, kHypothesisConverged, 0});
  }

  std::optional<Rigid3d> search() {
    RandomSampler sampler(options_.seed);
    std::optional<Rigid3d> best;
    float best_score = std::numeric_limits<float>::infinity();
    for (int i = 0; i < options_.ransac_iterations; ++i) {
      const std::optional<Rigid3d> motion = hypothesis(sampler.three_of(size()));
      if (!motion) continue;
      const float s = score(*motion);
      if (s >= best_score) continue;
      best_score = s;
      best = motion;
    }
    return best;
  }

  std::optional<Rigid3d> refine(Rigid3d motion) const {
    std::vector<int> inliers = find_inliers(motion);
    for (int i = 0; i < kMaxRefinements; ++i) {
      if (static_cast<int>(inliers.size()) < std::max(3, options_.min_inliers)) return std::nullopt;
      const auto refined = minimize(motion, inliers, kRefinementStop);
      if (!refined) return std::nullopt;
      motion = *refined;
      std::vector<int> now = find_inliers(motion);
      if (now == inliers) break;
      inliers = std::move(now);
    }
    return motion;
  }

  std::array<double, RectifiedStereo::kParamCount> params_;
  const StereoOdometerOptions& options_;
  std::vector<Point> points_;
  Eigen::Array<float, Eigen::Dynamic, 7> table_;  // X Y Z, u_left v_left u_right v_right
  Eigen::ArrayXf depth_, u_, v_, error_;          // of score(): allocated once
};

}  // namespace

std::string StereoOdometerOptions::validate() const {
  if (ransac_iterations < 1) return "ransac_iterations must be at least 1";
  if (!(inlier_threshold > 0)) return "inlier_threshold must be positive";
  if (min_inliers < 3) return "min_inliers must be at least 3";
  if (max_gauss_newton_iterations < 1) return "max_gauss_newton_iterations must be at least 1";
  return "";
}

std::optional<StereoMotionSolution> solve_stereo_motion(
    const Calibrated<RectifiedStereo>& camera,
    std::span<const StereoCorrespondence> correspondences, const StereoOdometerOptions& options) {
  return StereoMotionSolver(camera, correspondences, options).solve();
}

}  // namespace hybrid_slam
