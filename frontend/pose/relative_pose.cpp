#include "frontend/pose/relative_pose.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "cameras/geometry/so3.h"
#include "frontend/pose/damped_gauss_newton.h"
#include "frontend/pose/direction_residual.h"
#include "frontend/pose/random_sampler.h"
#include "frontend/pose/rigid_alignment.h"

namespace hybrid_slam {
namespace {

using Pairs = std::span<const PointPair>;

// The worse of the two ways.
double pair_chi2(const PointPair& pair, const Sim3d& a_from_b, const Sim3d& b_from_a) {
  return std::max(direction_chi2(pair.in_a, a_from_b * pair.in_b.point_in_world),
                  direction_chi2(pair.in_b, b_from_a * pair.in_a.point_in_world));
}

struct Consensus {
  RelativePose pose;
  double cost = std::numeric_limits<double>::infinity();  // each pair's chi2, cut off
};

Consensus consensus_at(Pairs pairs, const Sim3d& a_from_b, double chi2) {
  Consensus result{{a_from_b, std::vector<char>(pairs.size()), 0}, 0};
  const Sim3d b_from_a = inverse(a_from_b);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double value = pair_chi2(pairs[i], a_from_b, b_from_a);
    const bool inlier = value <= chi2;
    result.pose.inlier[i] = inlier;
    result.pose.inliers += inlier ? 1 : 0;
    result.cost += inlier ? value : chi2;
  }
  return result;
}

// d (exp(step) * point) / d step, the step being translation, rotation and, of a similarity, log
// scale.
template <int N>
Eigen::Matrix<double, 3, N> moved_by(const Eigen::Vector3d& point) {
  Eigen::Matrix<double, 3, N> d;
  d.template leftCols<3>().setIdentity();
  d.template middleCols<3>(3) = -hat(point);
  if constexpr (N == 7) d.col(6) = point;
  return d;
}

template <int N>
Sim3d moved(const Eigen::Matrix<double, N, 1>& step, const Sim3d& a_from_b) {
  Vector7d tangent = Vector7d::Zero();
  tangent.head<N>() = step;
  return sim3_exp(tangent) * a_from_b;
}

// Adds a direction's residual; the point moves with the unknowns by d_point.
template <int N>
void add_direction(const BearingObservation& seen, const Eigen::Vector3d& point,
                   const Eigen::Matrix<double, 3, N>& d_point, NormalEquations<N>* equations) {
  const std::optional<DirectionResidual> at = direction_residual(seen, point);
  if (at) equations->template add<2>(at->d_point * d_point, at->residual, 1);
  equations->cost += at ? at->residual.squaredNorm() : seen.whitening.squaredNorm();
}

template <int N>
NormalEquations<N> linearize(Pairs pairs, const std::vector<char>& inlier, const Sim3d& a_from_b) {
  NormalEquations<N> equations;
  const Sim3d b_from_a = inverse(a_from_b);
  const Eigen::Matrix3d turn = b_from_a.scale() * b_from_a.rotation().toRotationMatrix();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!inlier[i]) continue;
    const Eigen::Vector3d b_in_a = a_from_b * pairs[i].in_b.point_in_world;
    const Eigen::Vector3d& a_in_a = pairs[i].in_a.point_in_world;
    add_direction<N>(pairs[i].in_a, b_in_a, moved_by<N>(b_in_a), &equations);
    add_direction<N>(pairs[i].in_b, b_from_a * a_in_a, -turn * moved_by<N>(a_in_a), &equations);
  }
  return equations;
}

// Minimises the sum over the inliers in N unknowns: six of a rigid motion, seven of a similarity.
// None where they leave it open.
template <int N>
std::optional<Sim3d> minimize(Pairs pairs, const std::vector<char>& inlier, const Sim3d& a_from_b) {
  constexpr GaussNewtonStop kStop{20, 1e-8};
  const auto minimum = damped_gauss_newton<N>(
      a_from_b, [&](const Sim3d& pose) { return linearize<N>(pairs, inlier, pose); }, moved<N>,
      kStop);
  if (!minimum || !is_determined(minimum->equations.full_information())) return std::nullopt;
  return minimum->state;
}

std::optional<Sim3d> align(Pairs pairs, const std::array<int, 3>& sample, bool with_scale) {
  std::array<Eigen::Vector3d, 3> in_a;
  std::array<Eigen::Vector3d, 3> in_b;
  for (std::size_t k = 0; k < 3; ++k) {
    const PointPair& pair = pairs[static_cast<std::size_t>(sample[k])];
    in_a[k] = pair.in_a.point_in_world;
    in_b[k] = pair.in_b.point_in_world;
  }
  if (with_scale) return align_similarity(in_b, in_a);
  const std::optional<Rigid3d> rigid = align_rigid(in_b, in_a);
  if (!rigid) return std::nullopt;
  return Sim3d(*rigid);
}

// Each sample that is better than all before is refined; the best outcome counts.
std::optional<RelativePose> search(Pairs pairs, const RelativePoseOptions& options) {
  // A sample's points are as noisy as all others: its motion is not yet as good as its refinement.
  const double sample_chi2 = 4 * options.chi2;
  const int count = static_cast<int>(pairs.size());
  RandomSampler sampler(options.seed);
  double best_sample = std::numeric_limits<double>::infinity();
  std::optional<RelativePose> best;
  int iterations = options.max_iterations;
  for (int i = 0; i < iterations; ++i) {
    const std::optional<Sim3d> a_from_b = align(pairs, sampler.three_of(count), options.with_scale);
    if (!a_from_b) continue;
    const Consensus sample = consensus_at(pairs, *a_from_b, sample_chi2);
    if (sample.cost >= best_sample) continue;
    best_sample = sample.cost;
    auto refined = refine_relative_pose(pairs, *a_from_b, options);
    if (!refined || (best && refined->inliers <= best->inliers)) continue;
    best = std::move(refined);
    iterations = needed_samples(static_cast<double>(best->inliers) / count, options.confidence,
                                options.max_iterations);
  }
  return best;
}

bool is_usable(const PointPair& pair) { return pair.in_a.is_usable() && pair.in_b.is_usable(); }

}  // namespace

std::string RelativePoseOptions::validate() const {
  if (!(chi2 > 0)) return "relative pose: chi2 must be positive";
  if (!(confidence > 0 && confidence < 1) || max_iterations < 1 || refinement_rounds < 1) {
    return "relative pose: confidence must lie in (0, 1), iterations and rounds be positive";
  }
  return min_inliers < 3 ? "relative pose: min_inliers must be at least 3" : "";
}

std::optional<RelativePose> refine_relative_pose(Pairs pairs, const Sim3d& initial_a_from_b,
                                                 const RelativePoseOptions& options) {
  // The first rounds take in what a start that is off puts just beyond the threshold.
  Consensus now = consensus_at(pairs, initial_a_from_b, 4 * options.chi2);
  for (int round = 0; round < options.refinement_rounds; ++round) {
    if (now.pose.inliers < std::max(3, options.min_inliers)) return std::nullopt;
    const auto refined = options.with_scale
                             ? minimize<7>(pairs, now.pose.inlier, now.pose.a_from_b)
                             : minimize<6>(pairs, now.pose.inlier, now.pose.a_from_b);
    if (!refined) return std::nullopt;
    Consensus next = consensus_at(pairs, *refined, options.chi2);
    const bool settled = next.pose.inlier == now.pose.inlier;
    now = std::move(next);
    if (settled) break;
  }
  if (now.pose.inliers < std::max(3, options.min_inliers)) return std::nullopt;
  return std::move(now.pose);
}

std::optional<RelativePose> solve_relative_pose_ransac(Pairs pairs,
                                                       const RelativePoseOptions& options) {
  std::vector<PointPair> usable;
  std::vector<std::size_t> index;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!is_usable(pairs[i])) continue;
    usable.push_back(pairs[i]);
    index.push_back(i);
  }
  if (static_cast<int>(usable.size()) < std::max(3, options.min_inliers)) return std::nullopt;
  const std::optional<RelativePose> found = search(usable, options);
  if (!found) return std::nullopt;
  RelativePose result{found->a_from_b, std::vector<char>(pairs.size()), found->inliers};
  for (std::size_t i = 0; i < index.size(); ++i) result.inlier[index[i]] = found->inlier[i];
  return result;
}

}  // namespace hybrid_slam
