#include "frontend/matching/patch_alignment.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "frontend/matching/patch_sampling.h"

namespace hybrid_slam {
namespace {

using Level = ImagePyramid::Level;
using Samples = Eigen::VectorXf;

// What the target's grey values are made of, each without its mean over the patch: the derivatives
// by a shift of the patch, per pixel of the level; the values themselves (gain); the values times x
// and times y (a gain that changes across the patch); x and y (a veil that does). Along the row
// alone there is no shift along y; instead, the derivative by a shift along x is there times x and
// times y, too (a disparity that changes across the patch).
enum Column {
  kShiftX,
  kShiftY,
  kGain,
  kGainX,
  kGainY,
  kVeilX,
  kVeilY,
  kDisparityY,
  kColumns,
  kDisparityX = kShiftY,
};
using Columns = Eigen::Matrix<float, Eigen::Dynamic, kColumns>;
using Normal = SummedProducts;
static_assert(kColumns == kSummedColumns);

// Texture below this has no place: sum of squared gradients per sample [(grey levels / px)^2].
constexpr double kMinGradientEnergy = 0.5;
constexpr double kMaxGainRatio = 4;

// Whether samples can be taken in the box centre +- (rx, ry).
bool inside(const Level& level, double cx, double cy, double rx, double ry) {
  return cx - rx >= 1 && cy - ry >= 1 && cx + rx < level.width - 2 && cy + ry < level.height - 2;
}

Eigen::Index samples_of(int half_size) {
  const Eigen::Index side = 2 * half_size + 1;
  return side * side;
}

template <typename Vector>
void remove_mean(Vector&& values) {
  values.array() -= values.mean();
}

int level_of(double scale, int levels, const AlignmentOptions& options) {
  const int level = static_cast<int>(std::lround(std::log2(scale / options.scale_of_level0)));
  return std::clamp(level, 0, levels - 1);
}

// The target's samples under the current place, without their mean; false outside the image.
bool sample_target(const Level& level, int half_size, const Eigen::Matrix2d& warp,
                   const Eigen::Vector2d& centre, Samples* samples) {
  const Eigen::Vector2d reach = half_size * warp.cwiseAbs().rowwise().sum();
  if (!inside(level, centre.x(), centre.y(), reach.x(), reach.y())) return false;
  samples->resize(samples_of(half_size));
  if (warp.isIdentity(0)) {
    sample_square(level, centre.x(), centre.y(), half_size, samples->data());
  } else {
    sample_warped(level, centre, warp, half_size, samples->data());
  }
  remove_mean(*samples);
  return true;
}

void hold(int column, Normal* normal) {
  normal->row(column).setZero();
  normal->col(column).setZero();
  (*normal)(column, column) = 1;
}

// Whether enough texture is left beside gain, veil and their slopes.
bool has_place(const Normal& inverse, Eigen::Index samples, bool horizontal_only) {
  const double energy = kMinGradientEnergy * static_cast<double>(samples);
  const double along_x = 1 / inverse(0, 0);
  const double along_y = horizontal_only ? 0 : 1 / inverse(1, 1);
  return along_x + along_y >= energy;
}

// Three numbers are sought, each the scalar product of the target with a patch of weights.
void find_weights(const Columns& columns, Normal normal, bool horizontal_only,
                  ReferencePatch* patch) {
  if (!horizontal_only) hold(kDisparityY, &normal);
  Normal inverse = normal.inverse();
  patch->usable = inverse.allFinite() && has_place(inverse, columns.rows(), horizontal_only);
  if (!patch->usable) return;
  patch->weights.noalias() = columns * inverse.leftCols<3>().cast<float>();
  if (horizontal_only) patch->weights.col(kShiftY).setZero();
}

// How well the target's samples fit gain * values.
void judge(const ReferencePatch& patch, const Samples& target, Alignment* result) {
  const double tt = target.squaredNorm();
  const double rr = patch.energy;
  const double tr = target.dot(patch.values);
  result->correlation = tt > 0 ? tr / std::sqrt(tt * rr) : 0;
  const double squares = std::max(0.0, tt - tr * tr / rr);
  result->residual = std::sqrt(squares / static_cast<double>(target.size()));
}

// From samples with a rim of one pixel.
Columns columns_of(const Samples& samples, int half, bool horizontal_only) {
  const Eigen::Index side = 2 * Eigen::Index{half} + 3;
  Columns columns((side - 2) * (side - 2), kColumns);
  Eigen::Index i = 0;
  for (int v = -half; v <= half; ++v) {
    for (int u = -half; u <= half; ++u, ++i) {
      const float* s = samples.data() + (v + half + 1) * side + (u + half + 1);
      columns(i, kShiftX) = 0.5F * (s[1] - s[-1]);
      columns(i, kShiftY) = 0.5F * (s[side] - s[-side]);
      columns(i, kGain) = s[0];
      columns(i, kVeilX) = static_cast<float>(u);
      columns(i, kVeilY) = static_cast<float>(v);
    }
  }
  remove_mean(columns.col(kGain));
  const auto x = columns.col(kVeilX).array();
  const auto y = columns.col(kVeilY).array();
  columns.col(kGainX) = columns.col(kGain).array() * x;
  columns.col(kGainY) = columns.col(kGain).array() * y;
  columns.col(kDisparityY).setZero();
  if (horizontal_only) {
    columns.col(kDisparityX) = columns.col(kShiftX).array() * x;
    columns.col(kDisparityY) = columns.col(kShiftX).array() * y;
  }
  for (const auto k : {kShiftX, kShiftY, kGainX, kGainY, kDisparityY}) {
    remove_mean(columns.col(k));
  }
  return columns;
}

}  // namespace

std::string AlignmentOptions::validate() const {
  if (half_size < 1 || half_size > kMaxPatchHalfSize) return "half_size must lie in 1..50";
  if (!(scale_of_level0 > 0)) return "scale_of_level0 must be positive";
  if (max_iterations < 1) return "max_iterations must be positive";
  if (!(convergence > 0) || !(max_shift > 0)) return "convergence and max_shift must be positive";
  if (!(min_correlation <= 1)) return "min_correlation must not exceed 1";
  return {};
}

std::optional<ReferencePatch> make_reference_patch(const ImagePyramid& image, double x, double y,
                                                   double scale, const AlignmentOptions& options) {
  ReferencePatch patch;
  patch.level = level_of(scale, image.levels(), options);
  patch.half_size = options.half_size;
  const Level& level = image.level(patch.level);
  const double pixel = std::ldexp(1.0, patch.level);
  const double cx = x / pixel;
  const double cy = y / pixel;
  const int half = options.half_size;
  if (!inside(level, cx, cy, half + 1, half + 1)) return std::nullopt;

  Samples samples(samples_of(half + 1));
  sample_square(level, cx, cy, half + 1,
                samples.data());  // one more all around for the derivatives
  const Columns columns = columns_of(samples, half, options.horizontal_only);
  const Normal normal = sums_of_products(columns.data(), static_cast<std::size_t>(columns.rows()));
  const double along_y = options.horizontal_only ? 0 : normal(kShiftY, kShiftY);
  const double least = kMinGradientEnergy * static_cast<double>(columns.rows());
  if (normal(kShiftX, kShiftX) + along_y < least) return std::nullopt;
  find_weights(columns, normal, options.horizontal_only, &patch);
  patch.values = columns.col(kGain);
  patch.energy = normal(kGain, kGain);
  return patch;
}

Alignment align_patch(const ReferencePatch& patch, const ImagePyramid& target,
                      const Eigen::Matrix2d& target_from_reference, const Eigen::Vector2d& start,
                      const AlignmentOptions& options) {
  Alignment result;
  result.position = start;
  const double magnification = std::sqrt(std::abs(target_from_reference.determinant()));
  if (!(magnification > 0.1 && magnification < 10)) return result;
  // The target's level in which the patch's details have the size they have in the reference.
  const int level_index =
      std::clamp(patch.level + static_cast<int>(std::lround(std::log2(magnification))), 0,
                 target.levels() - 1);
  const Level& level = target.level(level_index);
  const double pixel = std::ldexp(1.0, level_index);
  const Eigen::Matrix2d warp = target_from_reference * std::ldexp(1.0, patch.level - level_index);

  if (!patch.usable) return result;
  const Eigen::Vector2d first = start / pixel;
  Eigen::Vector2d centre = first;
  Samples samples;
  for (int i = 0; i < options.max_iterations; ++i) {
    if (!sample_target(level, patch.half_size, warp, centre, &samples)) return result;
    const Eigen::Vector3d solution = (patch.weights.transpose() * samples).cast<double>();
    const double gain = solution.z();
    if (!(gain > 1 / kMaxGainRatio && gain < kMaxGainRatio)) return result;
    // The patch shifted by `solution / gain` looks like the target: the target's place moves back.
    const Eigen::Vector2d step = warp * (solution.head<2>() / gain);
    centre -= step;
    if (!((centre - first).norm() <= options.max_shift)) return result;
    if (step.norm() > options.convergence) continue;
    if (!sample_target(level, patch.half_size, warp, centre, &samples)) return result;
    result.position = centre * pixel;
    judge(patch, samples, &result);
    result.converged = result.correlation >= options.min_correlation;
    return result;
  }
  return result;
}

}  // namespace hybrid_slam
