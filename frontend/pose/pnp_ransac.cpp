#include "frontend/pose/pnp_ransac.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <opengv/absolute_pose/CentralAbsoluteAdapter.hpp>
#include <opengv/absolute_pose/methods.hpp>

#include "frontend/pose/direction_residual.h"
#include "frontend/pose/mlpnp.h"
#include "frontend/pose/random_sampler.h"

namespace hybrid_slam {
namespace {

constexpr double kChi2 = 5.991;    // 95 %, 2 degrees of freedom
constexpr double kMinSine = 1e-6;  // of the angles in a sample's triangle
constexpr int kRefinements = 20;   // at most; inliers are chosen anew before each

using Observations = std::span<const BearingObservation>;

// Sum of the squared residuals at a pose, each cut off at the threshold. Where it reaches
// `cost_limit` it is not summed to the end.
double truncated_cost(Observations observations, const Rigid3d& cam_from_world, double cost_limit) {
  const Eigen::Matrix3d rotation = cam_from_world.rotation().toRotationMatrix();
  const Eigen::Vector3d translation = cam_from_world.translation();
  double cost = 0;
  for (const BearingObservation& o : observations) {
    cost += std::min(bearing_chi2(o, rotation, translation), kChi2);
    if (cost >= cost_limit) break;
  }
  return cost;
}

struct Consensus {
  Rigid3d cam_from_world;
  double cost = std::numeric_limits<double>::infinity();  // truncated
  std::vector<char> inlier;
  std::vector<BearingObservation> inliers;
};

Consensus consensus_at(Observations observations, const Rigid3d& cam_from_world) {
  Consensus result{cam_from_world, 0, std::vector<char>(observations.size()), {}};
  const Eigen::Matrix3d rotation = cam_from_world.rotation().toRotationMatrix();
  const Eigen::Vector3d translation = cam_from_world.translation();
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const double s = bearing_chi2(observations[i], rotation, translation);
    result.cost += std::min(s, kChi2);
    result.inlier[i] = s <= kChi2;
    if (result.inlier[i]) result.inliers.push_back(observations[i]);
  }
  return result;
}

// Points or bearings on one line (through the centre, for bearings) leave the pose open.
bool is_degenerate(Observations observations, const std::array<int, 3>& sample) {
  const auto at = [&](int k) -> const BearingObservation& {
    return observations[static_cast<std::size_t>(sample[static_cast<std::size_t>(k)])];
  };
  const Eigen::Vector3d ab = at(1).point_in_world - at(0).point_in_world;
  const Eigen::Vector3d ac = at(2).point_in_world - at(0).point_in_world;
  const bool on_line = !(ab.cross(ac).norm() > kMinSine * ab.norm() * ac.norm());
  return on_line || !(at(0).bearing.cross(at(1).bearing).norm() > kMinSine) ||
         !(at(0).bearing.cross(at(2).bearing).norm() > kMinSine) ||
         !(at(1).bearing.cross(at(2).bearing).norm() > kMinSine);
}

// OpenGV's containers live as long as its adapter.
class MinimalSolver {
 public:
  explicit MinimalSolver(Observations observations) : adapter_(bearings_, points_) {
    bearings_.reserve(observations.size());
    points_.reserve(observations.size());
    for (const BearingObservation& o : observations) {
      bearings_.push_back(o.bearing);
      points_.push_back(o.point_in_world);
    }
  }

  // At most four poses that are finite.
  std::vector<Rigid3d> solve(const std::array<int, 3>& sample) const {
    std::vector<Rigid3d> poses;
    for (const opengv::transformation_t& world_from_cam :
         opengv::absolute_pose::p3p_kneip(adapter_, {sample.begin(), sample.end()})) {
      if (!world_from_cam.allFinite()) continue;
      const Rigid3d pose(Eigen::Quaterniond(Eigen::Matrix3d(world_from_cam.leftCols<3>())),
                         world_from_cam.col(3));
      poses.push_back(inverse(pose));
    }
    return poses;
  }

 private:
  opengv::bearingVectors_t bearings_;
  opengv::points_t points_;
  opengv::absolute_pose::CentralAbsoluteAdapter adapter_;
};

// MLPnP on the inliers, which are chosen anew, as long as that lowers the cost. None if they leave
// the pose open.
std::optional<Consensus> refine(Observations observations, Consensus best) {
  for (int i = 0; i < kRefinements; ++i) {
    const std::optional<Rigid3d> pose = solve_mlpnp(best.inliers, &best.cam_from_world);
    if (!pose) return std::nullopt;
    Consensus refined = consensus_at(observations, *pose);
    if (refined.cost > best.cost) break;
    const bool same = refined.inlier == best.inlier;
    best = std::move(refined);
    if (same) break;
  }
  return best;
}

// Each sample that is better than all samples before is refined; the best outcome counts.
Consensus search(Observations observations, const PnpRansacOptions& options) {
  const MinimalSolver solver(observations);
  const int count = static_cast<int>(observations.size());
  RandomSampler sampler(options.seed);
  Consensus best;
  double best_sample = std::numeric_limits<double>::infinity();
  int iterations = options.max_iterations;
  for (int i = 0; i < iterations; ++i) {
    const std::array<int, 3> sample = sampler.three_of(count);
    if (is_degenerate(observations, sample)) continue;
    for (const Rigid3d& pose : solver.solve(sample)) {
      const double cost = truncated_cost(observations, pose, best_sample);
      if (cost >= best_sample) continue;
      best_sample = cost;
      std::optional<Consensus> refined = refine(observations, consensus_at(observations, pose));
      if (!refined || refined->cost >= best.cost) continue;
      best = std::move(*refined);
      const double inliers = static_cast<double>(best.inliers.size());
      iterations = needed_samples(inliers / count, options.confidence, options.max_iterations);
    }
  }
  return best;
}

}  // namespace

std::optional<PnpResult> solve_pnp_ransac(std::span<const BearingObservation> observations,
                                          const PnpRansacOptions& options) {
  if (!(options.confidence > 0 && options.confidence < 1) || options.max_iterations < 1) {
    throw std::invalid_argument("solve_pnp_ransac: confidence or max_iterations out of range");
  }
  std::vector<BearingObservation> usable;
  std::vector<std::size_t> index;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    if (!observations[i].is_usable()) continue;
    usable.push_back(observations[i]);
    index.push_back(i);
  }
  const std::size_t needed = static_cast<std::size_t>(std::max(3, options.min_inliers));
  if (usable.size() < needed) return std::nullopt;
  const Consensus best = search(usable, options);
  if (best.inliers.size() < needed) return std::nullopt;
  PnpResult result{best.cam_from_world, std::vector<char>(observations.size()),
                   static_cast<int>(best.inliers.size())};
  for (std::size_t i = 0; i < index.size(); ++i) result.inlier[index[i]] = best.inlier[i];
  return result;
}

}  // namespace hybrid_slam
