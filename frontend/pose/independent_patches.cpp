#include "frontend/pose/independent_patches.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace hybrid_slam {
namespace {

constexpr float kHalfPatch = 6;  // sigma

// Places in the image that are near a given one, by rows of a fixed height.
class Chosen {
 public:
  explicit Chosen(float height) : rows_(static_cast<std::size_t>(row(height)) + 1) {}

  bool any_within(const Keypoint& keypoint, float distance) const {
    const int last = std::min(row(keypoint.y + distance), static_cast<int>(rows_.size()) - 1);
    for (int r = std::max(row(keypoint.y - distance), 0); r <= last; ++r) {
      for (const Keypoint& other : rows_[static_cast<std::size_t>(r)]) {
        if (std::abs(other.x - keypoint.x) < distance &&
            std::abs(other.y - keypoint.y) < distance) {
          return true;
        }
      }
    }
    return false;
  }

  void add(const Keypoint& keypoint) {
    rows_[static_cast<std::size_t>(std::max(row(keypoint.y), 0))].push_back(keypoint);
  }

 private:
  static constexpr float kRow = 8;  // [px]
  static int row(float y) { return static_cast<int>(std::floor(y / kRow)); }

  std::vector<std::vector<Keypoint>> rows_;
};

}  // namespace

int count_independent(std::vector<Keypoint> keypoints) {
  if (keypoints.empty()) return 0;
  std::sort(keypoints.begin(), keypoints.end(), [](const Keypoint& a, const Keypoint& b) {
    return std::tie(a.scale, a.y, a.x) < std::tie(b.scale, b.y, b.x);
  });
  float height = 0;
  for (const Keypoint& keypoint : keypoints) height = std::max(height, keypoint.y);
  Chosen chosen(height);
  int count = 0;
  for (const Keypoint& keypoint : keypoints) {
    if (chosen.any_within(keypoint, kHalfPatch * keypoint.scale)) continue;
    chosen.add(keypoint);
    ++count;
  }
  return count;
}

}  // namespace hybrid_slam
