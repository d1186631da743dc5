#include "apps/feature_eval/study/view_geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include <Eigen/SVD>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opengv/relative_pose/CentralRelativeAdapter.hpp>
#include <opengv/relative_pose/methods.hpp>

#include "cameras/geometry/so3.h"
#include "frontend/pose/random_sampler.h"

namespace hybrid_slam {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr int kSample = 5;

void check_sizes_of(const MatchedBearings& matches) {
  if (matches.a.size() != matches.b.size()) throw std::logic_error("bearings without a partner");
}

int count_of(const std::vector<char>& inlier) {
  return static_cast<int>(std::count(inlier.begin(), inlier.end(), 1));
}

// Whether the point that two rays meet in, nearly, lies ahead along both.
bool is_ahead(const Rigid3d& a_from_b, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d turned = a_from_b.rotation() * b;
  const Eigen::Vector3d t = a_from_b.translation();
  const double cosine = a.dot(turned), sine2 = 1 - cosine * cosine;
  if (sine2 <= 0) return true;  // parallel: as far away as can be
  // |depth_a a - depth_b turned - t| at its least.
  const double depth_a = (a.dot(t) - cosine * turned.dot(t)) / sine2;
  const double depth_b = (cosine * a.dot(t) - turned.dot(t)) / sine2;
  return depth_a > 0 && depth_b > 0;
}

// The one of the four motions of an essential matrix that has most inliers ahead of both cameras.
Rigid3d choose_motion(const Eigen::Matrix3d& essential, const MatchedBearings& matches,
                      const std::vector<char>& inlier) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU(), v = svd.matrixV(), w;
  if (u.determinant() < 0) u = -u;
  if (v.determinant() < 0) v = -v;
  w << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  Rigid3d best;
  int most = -1;
  for (const bool transposed : {false, true}) {
    const Eigen::Matrix3d rotation = u * (transposed ? w.transpose() : w) * v.transpose();
    for (const double sign : {1.0, -1.0}) {
      const Rigid3d motion(Eigen::Quaterniond(rotation), sign * u.col(2));
      int ahead = 0;
      for (std::size_t i = 0; i < inlier.size(); ++i) {
        if (inlier[i] != 0 && is_ahead(motion, matches.a[i], matches.b[i])) ++ahead;
      }
      if (ahead > most) {
        most = ahead;
        best = motion;
      }
    }
  }
  return best;
}

std::vector<char> inliers_of(const Eigen::Matrix3d& essential, const MatchedBearings& matches,
                             double threshold) {
  std::vector<char> inlier(matches.a.size());
  for (std::size_t i = 0; i < inlier.size(); ++i) {
    inlier[i] = sphere_distance(essential, matches.a[i], matches.b[i]) <= threshold ? 1 : 0;
  }
  return inlier;
}

std::array<int, kSample> five_of(int count, RandomSampler& sampler) {
  std::array<int, kSample> sample{};
  for (int i = 0; i < kSample; ++i) {
    const auto end = sample.begin() + i;
    do {
      sample[static_cast<std::size_t>(i)] = sampler.below(count);
    } while (std::find(sample.begin(), end, *end) != end);
  }
  return sample;
}

int needed_iterations(double inlier_share, const ConsensusOptions& options) {
  const double good_sample = std::pow(inlier_share, kSample);
  if (good_sample >= 1) return 1;
  const double needed = std::log(1 - options.confidence) / std::log1p(-good_sample);
  return needed < options.max_iterations ? static_cast<int>(std::ceil(needed))
                                         : options.max_iterations;
}

opengv::essentials_t solve_sample(const MatchedBearings& matches,
                                  const std::array<int, kSample>& sample) {
  opengv::bearingVectors_t a, b;
  for (const int i : sample) {
    a.push_back(matches.a[static_cast<std::size_t>(i)]);
    b.push_back(matches.b[static_cast<std::size_t>(i)]);
  }
  const opengv::relative_pose::CentralRelativeAdapter adapter(a, b);
  return opengv::relative_pose::fivept_nister(adapter);
}

}  // namespace

std::optional<ViewMotion> motion_on_plane(const MatchedBearings& matches,
                                          const ConsensusOptions& options) {
  check_sizes_of(matches);
  std::vector<cv::Point2d> a, b;
  std::vector<std::size_t> index;
  for (std::size_t i = 0; i < matches.a.size(); ++i) {
    const Eigen::Vector3d &ray_a = matches.a[i], &ray_b = matches.b[i];
    if (ray_a.z() <= 0 || ray_b.z() <= 0) continue;
    a.emplace_back(ray_a.x() / ray_a.z(), ray_a.y() / ray_a.z());
    b.emplace_back(ray_b.x() / ray_b.z(), ray_b.y() / ray_b.z());
    index.push_back(i);
  }
  if (a.size() < static_cast<std::size_t>(kMinMatches)) return std::nullopt;
  const cv::Mat camera = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat mask, rotation, translation;
  const cv::Mat essential = cv::findEssentialMat(b, a, camera, cv::RANSAC, options.confidence,
                                                 options.threshold, options.max_iterations, mask);
  if (essential.rows != 3) return std::nullopt;
  ViewMotion motion;
  motion.inlier.assign(matches.a.size(), 0);
  for (std::size_t i = 0; i < index.size(); ++i) {
    motion.inlier[index[i]] = mask.at<std::uint8_t>(static_cast<int>(i)) != 0 ? 1 : 0;
  }
  motion.inliers = count_of(motion.inlier);
  if (motion.inliers < kMinMatches) return std::nullopt;
  cv::recoverPose(essential, b, a, camera, rotation, translation, mask);
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> r(rotation.ptr<double>());
  const Eigen::Map<const Eigen::Vector3d> t(translation.ptr<double>());
  motion.a_from_b = Rigid3d(Eigen::Quaterniond(Eigen::Matrix3d(r)), t);
  return motion;
}

double sphere_distance(const Eigen::Matrix3d& essential, const Eigen::Vector3d& a,
                       const Eigen::Vector3d& b) {
  const Eigen::Vector3d by_a = essential * b, by_b = essential.transpose() * a;
  const double residual = a.dot(by_a);
  // Bearings turn in their tangent planes only.
  const double slope2 =
      by_a.squaredNorm() - residual * residual + by_b.squaredNorm() - residual * residual;
  return slope2 > 0 ? std::abs(residual) / std::sqrt(slope2) : 0;
}

std::optional<ViewMotion> motion_on_bearings(const MatchedBearings& matches,
                                             const ConsensusOptions& options) {
  check_sizes_of(matches);
  const int count = static_cast<int>(matches.a.size());
  if (count < kMinMatches) return std::nullopt;
  RandomSampler sampler(0);
  ViewMotion best;
  Eigen::Matrix3d best_essential;
  int needed = options.max_iterations;
  for (int iteration = 0; iteration < needed; ++iteration) {
    for (const Eigen::Matrix3d& essential : solve_sample(matches, five_of(count, sampler))) {
      if (!essential.allFinite()) continue;
      std::vector<char> inlier = inliers_of(essential, matches, options.threshold);
      const int inliers = count_of(inlier);
      if (inliers <= best.inliers) continue;
      best.inliers = inliers;
      best.inlier = std::move(inlier);
      best_essential = essential;
      needed = needed_iterations(static_cast<double>(inliers) / count, options);
    }
  }
  if (best.inliers < kMinMatches) return std::nullopt;
  best.a_from_b = choose_motion(best_essential, matches, best.inlier);
  return best;
}

double rotation_error_deg(const Rigid3d& estimate, const Rigid3d& truth) {
  return so3_log(estimate.rotation() * truth.rotation().conjugate()).norm() * kDegrees;
}

double direction_error_deg(const Rigid3d& estimate, const Rigid3d& truth) {
  const Eigen::Vector3d a = estimate.translation(), b = truth.translation();
  return std::atan2(a.cross(b).norm(), a.dot(b)) * kDegrees;
}

}  // namespace hybrid_slam
