#include "frontend/tracking/moving_regions.h"

#include <algorithm>
#include <cmath>

#include "cameras/rectified_stereo.h"

namespace hybrid_slam {
namespace {

constexpr int kColumns = 24;        // cells along the longer side of the image
constexpr double kMemory = 2;       // [s]
constexpr double kAgreement = 2;    // [px], of the odometer's inliers
constexpr double kContradicts = 6;  // [px]; the calibration of a rig that still maps is off by less

// Chance that as many wrong matches as were seen meet in one place: of one in a million frames.
constexpr double kLogChance = -13.8;

// Share of wrong matches that is assumed in any case, so that a handful of them in an otherwise
// perfect image is no region.
constexpr double kMinWrong = 0.1;

// Natural logarithm of a bound on the chance of a share of at least m / n, where q is expected
// (Chernoff; Hoeffding 1963, theorem 1). n need not be whole.
double log_chance(double m, double n, double q) {
  const double p = m / n;
  if (p <= q) return 0;
  const double rest = p < 1 ? (1 - p) * std::log((1 - p) / (1 - q)) : 0;
  return -n * (p * std::log(p / q) + rest);
}

}  // namespace

std::vector<FollowedFeature> followed_features(const Calibrated<RectifiedStereo>& camera,
                                               const StereoFeatures& previous,
                                               const StereoFeatures& current,
                                               std::span<const CircularMatch> matches,
                                               const Rigid3d& current_from_previous) {
  std::vector<FollowedFeature> features;
  for (const CircularMatch& match : matches) {
    const auto i = static_cast<std::size_t>(match.previous);
    const auto j = static_cast<std::size_t>(match.current);
    const Keypoint& before = previous.left.keypoints[i];
    const Keypoint& now = current.left.keypoints[j];
    const auto point = triangulate_stereo(camera, {before.x, before.y, previous.u_right[i]});
    if (!point) continue;
    const auto still = project(camera, current_from_previous * *point);
    if (!still || std::hypot(still->x() - before.x, still->y() - before.y) < kContradicts) continue;
    const double off = std::hypot(still->x() - now.x, still->y() - now.y);
    if (off <= kAgreement || off >= kContradicts) {
      features.push_back({now.x, now.y, off >= kContradicts});
    }
  }
  return features;
}

MovingRegions::MovingRegions(int width, int height)
    : cell_(std::max(1.0, static_cast<double>(std::max(width, height)) / kColumns)),
      columns_(std::max(1, static_cast<int>(std::ceil(width / cell_)))),
      rows_(std::max(1, static_cast<int>(std::ceil(height / cell_)))),
      evidence_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)),
      moves_(evidence_.size(), 0) {}

void MovingRegions::add(double seconds, std::span<const FollowedFeature> features) {
  if (features.empty()) return;
  const double kept = std::exp(-std::max(0.0, seconds) / kMemory);
  for (Evidence& one : evidence_) one = {kept * one.still, kept * one.moving};
  for (const FollowedFeature& feature : features) {
    Evidence& one = evidence_[cell_of(feature.x, feature.y)];
    (feature.moves ? one.moving : one.still) += 1;
  }
  judge();
}

bool MovingRegions::contains(double x, double y) const { return moves_[cell_of(x, y)] != 0; }

double MovingRegions::share() const {
  return static_cast<double>(std::count(moves_.begin(), moves_.end(), 1)) /
         static_cast<double>(moves_.size());
}

std::size_t MovingRegions::cell_of(double x, double y) const {
  const int column = std::clamp(static_cast<int>(x / cell_), 0, columns_ - 1);
  const int row = std::clamp(static_cast<int>(y / cell_), 0, rows_ - 1);
  return static_cast<std::size_t>(row * columns_ + column);
}

// Of a cell and its eight neighbours.
MovingRegions::Evidence MovingRegions::around(int column, int row) const {
  Evidence sum;
  for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r) {
    for (int c = std::max(0, column - 1); c <= std::min(columns_ - 1, column + 1); ++c) {
      const Evidence& one = evidence_[static_cast<std::size_t>(r * columns_ + c)];
      sum.still += one.still;
      sum.moving += one.moving;
    }
  }
  return sum;
}

void MovingRegions::judge() {
  Evidence all;
  for (const Evidence& one : evidence_) {
    all.still += one.still;
    all.moving += one.moving;
  }
  const double wrong = std::max(kMinWrong, all.moving / (all.still + all.moving));
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const auto i = static_cast<std::size_t>(row * columns_ + column);
      const Evidence here = around(column, row);
      const Evidence own = evidence_[i];
      moves_[i] = here.moving > here.still && own.moving >= own.still &&
                          log_chance(here.moving, here.still + here.moving, wrong) <= kLogChance
                      ? 1
                      : 0;
    }
  }
}

}  // namespace hybrid_slam
