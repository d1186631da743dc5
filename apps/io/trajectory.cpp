#include "apps/io/trajectory.h"

#include <algorithm>
#include <cmath>

#include "frontend/pose/rigid_alignment.h"

namespace hybrid_slam {

namespace {

// Index of the pose nearest in time. `poses` is not empty.
std::size_t nearest(std::span<const StampedPose> poses, double time) {
  const auto after = std::lower_bound(poses.begin(), poses.end(), time,
                                      [](const StampedPose& p, double t) { return p.time < t; });
  const auto index = static_cast<std::size_t>(after - poses.begin());
  if (index == 0) return 0;
  if (index == poses.size()) return index - 1;
  return time - poses[index - 1].time <= poses[index].time - time ? index - 1 : index;
}

std::optional<Sim3d> align(std::span<const PosePair> pairs, TrajectoryAlignment alignment) {
  if (alignment == TrajectoryAlignment::kNone) return Sim3d();
  std::vector<Eigen::Vector3d> estimate, truth;
  for (const PosePair& pair : pairs) {
    estimate.emplace_back(pair.estimate.translation());
    truth.emplace_back(pair.truth.translation());
  }
  if (alignment == TrajectoryAlignment::kSim3) {
    const auto same = [&](const Eigen::Vector3d& position) { return position == estimate[0]; };
    if (std::all_of(estimate.begin(), estimate.end(), same)) return std::nullopt;  // no scale
    return align_similarity(estimate, truth, CollinearPoints::kAlign);
  }
  const auto rigid = align_rigid(estimate, truth, CollinearPoints::kAlign);
  return rigid ? std::optional(Sim3d(*rigid)) : std::nullopt;
}

}  // namespace

std::vector<PosePair> associate(std::span<const StampedPose> estimate,
                                std::span<const StampedPose> truth, double max_difference) {
  std::vector<PosePair> pairs;
  if (truth.empty()) return pairs;
  std::optional<std::size_t> last_truth;
  for (const StampedPose& pose : estimate) {
    const std::size_t index = nearest(truth, pose.time);
    const StampedPose& true_pose = truth[index];
    const double difference = std::abs(true_pose.time - pose.time);
    if (!(difference <= max_difference)) continue;
    if (last_truth == index) {
      if (std::abs(true_pose.time - pairs.back().time) <= difference) continue;
      pairs.pop_back();
    }
    last_truth = index;
    pairs.push_back({pose.time, pose.world_from_cam, true_pose.world_from_cam});
  }
  return pairs;
}

ErrorStatistics error_statistics(std::vector<double> errors) {
  ErrorStatistics statistics;
  statistics.count = errors.size();
  if (errors.empty()) return statistics;
  const double count = static_cast<double>(errors.size());
  for (const double error : errors) {
    statistics.mean += error / count;
    statistics.rmse += error * error / count;
  }
  statistics.rmse = std::sqrt(statistics.rmse);
  std::sort(errors.begin(), errors.end());
  const std::size_t middle = errors.size() / 2;
  statistics.median =
      errors.size() % 2 == 1 ? errors[middle] : 0.5 * (errors[middle - 1] + errors[middle]);
  statistics.max = errors.back();
  return statistics;
}

std::optional<double> AbsoluteError::length_ratio() const {
  if (!(true_length > 0)) return std::nullopt;
  return estimated_length / true_length;
}

std::optional<AbsoluteError> absolute_error(std::span<const PosePair> pairs,
                                            TrajectoryAlignment alignment) {
  if (pairs.empty()) return std::nullopt;
  const std::optional<Sim3d> truth_from_estimate = align(pairs, alignment);
  if (!truth_from_estimate) return std::nullopt;
  AbsoluteError result;
  result.truth_from_estimate = *truth_from_estimate;
  std::vector<double> errors;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector3d estimate = pairs[i].estimate.translation();
    const Eigen::Vector3d truth = pairs[i].truth.translation();
    errors.push_back((*truth_from_estimate * estimate - truth).norm());
    if (i == 0) continue;
    result.estimated_length += (estimate - pairs[i - 1].estimate.translation()).norm();
    result.true_length += (truth - pairs[i - 1].truth.translation()).norm();
  }
  result.position = error_statistics(std::move(errors));
  return result;
}

std::optional<RelativeError> relative_error(std::span<const PosePair> pairs, std::size_t delta,
                                            double estimate_scale) {
  if (delta == 0) throw std::logic_error("delta is at least 1");
  if (pairs.size() <= delta) return std::nullopt;
  std::vector<double> translations, rotations;
  for (std::size_t i = 0; i + delta < pairs.size(); ++i) {
    const PosePair& first = pairs[i];
    const PosePair& second = pairs[i + delta];
    Rigid3d estimated = inverse(first.estimate) * second.estimate;
    estimated.translation() *= estimate_scale;
    const Rigid3d error = inverse(inverse(first.truth) * second.truth) * estimated;
    const Eigen::Quaterniond turn(error.rotation());
    translations.push_back(error.translation().norm());
    rotations.push_back(2 * std::atan2(turn.vec().norm(), std::abs(turn.w())));
  }
  return RelativeError{error_statistics(std::move(translations)),
                       error_statistics(std::move(rotations))};
}

}  // namespace hybrid_slam
