#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace hybrid_slam {

// The rays of one view's keypoints, to be searched along epipolar planes: what lies far off a plane
// is sorted out in single precision, many rays at once.
class EpipolarBand {
 public:
  // `bearing`: of unit length. `variance` of its direction [rad^2].
  void add(const Eigen::Vector3d& bearing, double variance);

  // The places (0 for the first that was added) of all rays with
  //   (normal . bearing)^2 <= factor * (variance of the ray + variance),
  // ascending, and of a few more that rounding may put there: 1 % of the band and 1e-5 rad.
  // `normal`: of unit length.
  void find(const Eigen::Vector3d& normal, double variance, double factor,
            std::vector<std::uint32_t>& found) const;

 private:
  // By coordinate, as long as whole vectors; what pads them is never found.
  std::vector<float> x_, y_, z_, variance_;
  std::size_t size_ = 0;
};

}  // namespace hybrid_slam
