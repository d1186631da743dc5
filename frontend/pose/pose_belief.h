#pragma once

#include <limits>
#include <vector>

#include "cameras/geometry/se3.h"

namespace hybrid_slam {

// What speaks for a pose.
struct PoseSupport {
  int candidates = 0;  // matches that it was looked for in, right or wrong: independent ones
  int inliers = 0;     // matches that agree with it, all of them
  int evidence = 0;    // independent ones that agree: see independent_patches.h
  // That a wrong match agrees with a given pose: the area around the point's projection that counts
  // as agreement, over the area in which the match was looked for. At most 1.
  double chance = 1;
  // Of the left perturbation (translation, rotation); not finite where the pose is left open.
  Matrix6d covariance = Matrix6d::Constant(std::numeric_limits<double>::quiet_NaN());
  double depth = 0;  // median distance of the inliers' points [m]
};

// log10 of the number of poses with so much evidence that is to be expected among wrong matches
// alone. `sample` of it made the pose; the rest agreed by themselves:
//   (n - s) C(n, k) C(k, s) chance^(k - s),
// Moisan and Stival, "A probabilistic criterion to detect rigid point matches", IJCV 2004, eq. 7,
// with a tolerance that is fixed beforehand. Infinite with no more evidence than the sample.
double log10_false_alarms(const PoseSupport& support, int sample = 3);

// Fewer than one in a million frames.
bool is_no_accident(const PoseSupport& support);

// Largest standard deviation of a pose's translation [m], along any direction.
double translation_sigma(const Matrix6d& covariance);

// Whether the camera's place is known to 2 % of the scene's distance, 1 sigma.
bool is_certain(const Matrix6d& covariance, double depth);

// Both: no accident, and certain.
bool is_believed(const PoseSupport& support);

// Of a pose in an image of so many pixels [px^2], with matches looked for all over it: the chance
// of an observation with this standard deviation [px] that counts up to `chi2`.
double chance_in_area(double sigma, double chi2, double area);

// The inverse of an information; not finite where that leaves the pose open.
Matrix6d covariance_of_information(const Matrix6d& information);

// 0 of nothing.
double median_of(std::vector<double> values);

}  // namespace hybrid_slam
