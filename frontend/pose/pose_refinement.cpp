#include "frontend/pose/pose_refinement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>
#include <variant>

#include "cameras/geometry/se3.h"
#include "factors/reprojection.h"
#include "frontend/pose/damped_gauss_newton.h"

namespace hybrid_slam {
namespace {

constexpr int kMinObservations = 3;
constexpr double kConverged = 1e-9;         // step [m, rad] after which a minimisation is done
constexpr double kRoughlyConverged = 1e-5;  // the same where another round follows anyway
constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool has_right(const PoseObservation& observation) {
  return !std::isnan(observation.measurement.z());
}

bool is_usable(const PoseObservation& o) {
  return o.point_in_world.allFinite() && o.measurement.head<2>().allFinite() &&
         !std::isinf(o.measurement.z()) && o.sigma > 0 && std::isfinite(o.sigma);
}

struct HuberWeight {
  double cost;    // rho(s)
  double weight;  // rho'(s)
};

// Huber's loss of a squared residual s with the threshold sqrt(chi2).
HuberWeight huber(double s, double chi2) {
  if (s <= chi2) return {s, 1};
  const double norm = std::sqrt(s);
  const double threshold = std::sqrt(chi2);
  return {2 * threshold * norm - chi2, threshold / norm};
}

template <ProjectionModel M>
class PoseRefiner {
 public:
  PoseRefiner(const double* params, std::span<const PoseObservation> observations,
              const PoseRefinementOptions& options)
      : params_(params),
        observations_(observations),
        options_(options),
        inlier_(observations.size()) {}

  PoseRefinementResult run(const Rigid3d& initial) {
    PoseRefinementResult result;
    result.cam_from_world = initial;
    select(initial, options_.first_scale);
    for (int round = 0; round < options_.rounds && inliers_ >= kMinObservations; ++round) {
      const bool robust = round < options_.robust_rounds;
      const bool last = round + 1 == options_.rounds;
      result.cam_from_world =
          minimize(result.cam_from_world, robust, robust && !last ? kRoughlyConverged : kConverged);
      const bool changed = select(result.cam_from_world, 1);
      // The same observations again would give the same pose again.
      if (!changed && robust) round = std::max(round, options_.robust_rounds - 1);
      if (!changed && !robust) break;
    }
    summarize(initial, &result);
    return result;
  }

 private:
  // Calls f with the model that fits what was measured: the left camera alone where a stereo pair
  // has no right match.
  template <typename F>
  static auto with_model(const PoseObservation& observation, F&& f) {
    if constexpr (M::kMeasurementDim == 3) {
      if (!has_right(observation)) return f.template operator()<Pinhole>();
    }
    return f.template operator()<M>();
  }

  double threshold(const PoseObservation& observation) const {
    return M::kMeasurementDim == 3 && has_right(observation) ? options_.chi2_stereo
                                                             : options_.chi2_mono;
  }

  // Squared whitened residual; infinite if the point cannot be projected.
  double chi2(const Rigid3d& cam_from_world, const PoseObservation& o) const {
    return with_model(o, [&]<typename Model>() {
      Eigen::Matrix<double, Model::kMeasurementDim, 1> residual;
      if (!reprojection_residual<Model>(params_, cam_from_world.params.data(),
                                        o.point_in_world.data(), o.measurement.data(), 1 / o.sigma,
                                        residual.data(), nullptr, nullptr, nullptr)) {
        return kInfinity;
      }
      const double s = residual.squaredNorm();
      return std::isfinite(s) ? s : kInfinity;
    });
  }

  // Inliers at a pose, their thresholds multiplied by `scale`. True if any came or went.
  bool select(const Rigid3d& cam_from_world, double scale) {
    bool changed = false;
    inliers_ = 0;
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      const PoseObservation& o = observations_[i];
      const double s = is_usable(o) ? chi2(cam_from_world, o) : kInfinity;
      const char inlier = s < kInfinity && s <= scale * threshold(o);
      changed |= inlier != inlier_[i];
      inlier_[i] = inlier;
      inliers_ += inlier;
    }
    return changed;
  }

  // None if one of the inliers cannot be projected from this pose.
  std::optional<NormalEquations<6>> linearize(const Rigid3d& cam_from_world, bool robust) const {
    NormalEquations<6> equations;
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      if (!inlier_[i]) continue;
      const PoseObservation& o = observations_[i];
      const bool projected = with_model(o, [&]<typename Model>() {
        constexpr int kDim = Model::kMeasurementDim;
        Eigen::Matrix<double, kDim, 1> residual;
        Eigen::Matrix<double, kDim, 6, Eigen::RowMajor> jacobian;
        if (!reprojection_residual<Model>(params_, cam_from_world.params.data(),
                                          o.point_in_world.data(), o.measurement.data(),
                                          1 / o.sigma, residual.data(), jacobian.data(), nullptr,
                                          nullptr)) {
          return false;
        }
        const double s = residual.squaredNorm();
        const HuberWeight loss = robust ? huber(s, threshold(o)) : HuberWeight{s, 1};
        equations.cost += loss.cost;
        equations.add<kDim>(jacobian, residual, loss.weight);
        return true;
      });
      if (!projected) return std::nullopt;
    }
    if (!std::isfinite(equations.cost)) return std::nullopt;
    return equations;
  }

  // Over the inliers, until a step is shorter than `converged`.
  Rigid3d minimize(const Rigid3d& initial, bool robust, double converged) const {
    const auto minimum = damped_gauss_newton<6>(
        initial, [&](const Rigid3d& pose) { return linearize(pose, robust); }, left_perturbed,
        {options_.iterations, converged});
    return minimum ? minimum->state : initial;
  }

  void summarize(const Rigid3d& initial, PoseRefinementResult* result) {
    result->information.setZero();
    const std::optional<NormalEquations<6>> final =
        inliers_ >= kMinObservations ? linearize(result->cam_from_world, false) : std::nullopt;
    if (!final) {
      result->cam_from_world = initial;
      result->inlier.assign(observations_.size(), 0);
      return;
    }
    result->information = final->full_information();
    result->inlier = std::move(inlier_);
    result->inliers = inliers_;
    result->rms = std::sqrt(final->cost / residual_count(result->inlier));
  }

  double residual_count(const std::vector<char>& inlier) const {
    int count = 0;
    for (std::size_t i = 0; i < inlier.size(); ++i) {
      if (inlier[i]) count += M::kMeasurementDim == 3 && has_right(observations_[i]) ? 3 : 2;
    }
    return count;
  }

  const double* params_;
  std::span<const PoseObservation> observations_;
  const PoseRefinementOptions& options_;
  std::vector<char> inlier_;
  int inliers_ = 0;
};

}  // namespace

double inlier_efficiency(int dimension, double chi2) {
  const double half = 0.5 * chi2;
  const double tail = std::exp(-half);
  if (dimension == 2) return 1 - half * tail / (1 - tail);
  const double cut = std::sqrt(half) * tail / std::tgamma(1.5);  // P_3 = P_1 - this
  return 1 - half * cut / (1.5 * (std::erf(std::sqrt(half)) - cut));
}

PoseRefinementResult refine_pose(const Camera& camera, const Rigid3d& initial_cam_from_world,
                                 std::span<const PoseObservation> observations,
                                 const PoseRefinementOptions& options) {
  if (!initial_cam_from_world.params.allFinite()) {
    throw std::invalid_argument("refine_pose: the initial pose is not finite");
  }
  return std::visit(
      [&](const auto& calibrated) {
        using Model = typename std::decay_t<decltype(calibrated)>::Model;
        return PoseRefiner<Model>(calibrated.params.data(), observations, options)
            .run(initial_cam_from_world);
      },
      camera);
}

}  // namespace hybrid_slam
