#include "test/frontend/features/feature_agreement.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <vector>

namespace hybrid_slam {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

double angle_between(const Keypoint& a, const Keypoint& b) {
  return std::abs(std::remainder(a.angle - b.angle, 2 * std::numbers::pi)) / kDegree;
}

double angle_between(const Descriptor& a, const Descriptor& b) {
  double product = 0, square_a = 0, square_b = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    product += a[i] * b[i];
    square_a += a[i] * a[i];
    square_b += b[i] * b[i];
  }
  return std::acos(std::min(1.0, product / std::sqrt(square_a * square_b))) / kDegree;
}

int worst_difference(const Descriptor& a, const Descriptor& b) {
  int worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, std::abs(a[i] - b[i]));
  return worst;
}

// The index in `keypoints`, or -1.
int find_like(const std::vector<Keypoint>& keypoints, const Keypoint& wanted) {
  int best = -1;
  double least = 360;
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const Keypoint& k = keypoints[i];
    if (std::hypot(k.x - wanted.x, k.y - wanted.y) > 0.1) continue;
    if (std::abs(k.scale / wanted.scale - 1) > 0.02) continue;
    const double angle = angle_between(k, wanted);
    if (angle >= least) continue;
    least = angle;
    best = static_cast<int>(i);
  }
  return best;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

bool same_bytes(const FeatureSet& a, const FeatureSet& b) {
  return a.size() == b.size() && a.descriptors == b.descriptors &&
         std::memcmp(a.keypoints.data(), b.keypoints.data(), a.size() * sizeof(Keypoint)) == 0;
}

FeatureAgreement feature_agreement(const FeatureSet& a, const FeatureSet& b) {
  FeatureAgreement result;
  if (a.size() == 0) return result;
  std::vector<double> angles, descriptor_angles;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const int found = find_like(b.keypoints, a.keypoints[i]);
    if (found < 0) continue;
    const auto j = static_cast<std::size_t>(found);
    angles.push_back(angle_between(a.keypoints[i], b.keypoints[j]));
    descriptor_angles.push_back(angle_between(a.descriptors[i], b.descriptors[j]));
    if (angles.back() > 0.5) continue;
    const int worst = worst_difference(a.descriptors[i], b.descriptors[j]);
    result.worst_byte = std::max(result.worst_byte, worst);
  }
  result.found = static_cast<double>(angles.size()) / static_cast<double>(a.size());
  if (angles.empty()) return {0, 180, 180, 255};
  result.median_angle = median(angles);
  result.median_descriptor_angle = median(descriptor_angles);
  return result;
}

}  // namespace hybrid_slam
