#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "frontend/matching/image_pyramid.h"

namespace hybrid_slam {

struct AlignmentOptions {
  int half_size = 7;             // the patch has (2 half_size + 1)^2 samples
  double scale_of_level0 = 3.2;  // keypoint scale [px] for which the finest level is right
  int max_iterations = 20;
  double convergence = 0.003;  // largest last step [px of the level]
  double max_shift = 2.0;      // from the start [px of the level]
  double min_correlation = 0.8;
  bool horizontal_only = false;  // move along the reference's x axis alone

  std::string validate() const;
};

// A square patch of a reference image around a keypoint, with what its alignment needs. Samples are
// one pixel of its pyramid level apart, row by row.
struct ReferencePatch {
  int level = 0;
  int half_size = 0;
  bool usable = false;  // enough texture is left beside gain, veil and their slopes
  // What a target says of the shift [px of the level] and the gain: (shift_x, shift_y, gain) =
  // weights^T target. The gain's slopes and the veil's are estimated along with them.
  Eigen::Matrix<float, Eigen::Dynamic, 3> weights;
  Eigen::VectorXf values;  // without their mean
  double energy = 0;       // squared norm of the values
};

// The patch around (x, y) [px] in the pyramid level that fits a keypoint's scale [px], for
// alignment with the same options. None where it would leave the image or has no texture.
std::optional<ReferencePatch> make_reference_patch(const ImagePyramid& image, double x, double y,
                                                   double scale, const AlignmentOptions& options);

struct Alignment {
  bool converged = false;          // and every limit of the options holds
  Eigen::Vector2d position{0, 0};  // of the patch's centre in the target image [px]
  double correlation = 0;          // zero-mean normalised, -1..1
  double residual = 0;             // root mean square [grey levels] after gain and bias
};

// Finds the place in `target` that looks like the patch: inverse compositional Lucas-Kanade (Baker
// and Matthews 2004) over the position with gain and bias and their slopes, which are linear and so
// part of every step. Lamps on the vehicle and the veil of scattered light move along with the
// camera: without slopes they hold the patches back, and every motion comes out too short. Along
// the row alone the disparity's slopes are estimated in the same way: ground that slants has
// another disparity at each sample, of which texture that lies to one side shows its own.
// `target_from_reference`: how offsets from the centre map between the images, fixed. `start`:
// within about a pixel of the patch's level. Deterministic.
Alignment align_patch(const ReferencePatch& patch, const ImagePyramid& target,
                      const Eigen::Matrix2d& target_from_reference, const Eigen::Vector2d& start,
                      const AlignmentOptions& options);

}  // namespace hybrid_slam
