#pragma once

#include <vector>

#include "apps/scene_renderer/sequence.h"
#include "backend/map/features.h"
#include "frontend/features/image.h"

namespace hybrid_slam {

Camera left_camera(const SceneSequence& sequence);

GrayImage gray(const ColorImage& image);

FeatureSet sift_of(const ColorImage& image, int features);

// Two features that look alike, in mutual agreement.
struct PixelMatch {
  Eigen::Vector2d from, to;
};
std::vector<PixelMatch> match_sift(const FeatureSet& from, const FeatureSet& to, double ratio);

// Where matched features lie beside where the truth puts them: through the depth that a ray cast
// into the scene finds, and the poses.
struct TruthErrors {
  std::vector<Eigen::Vector2d> errors;  // [px], of matches nearer than 12 px
  std::size_t gross = 0;                // matches that lie farther off
  double median() const;                // [px]
  Eigen::Vector2d median_offset() const;
};
TruthErrors compare_with_truth(const std::vector<PixelMatch>& matches, const RayCaster& seafloor,
                               const Camera& from, const Rigid3d& world_from_from, const Camera& to,
                               const Rigid3d& world_from_to);

double median(std::vector<double> values);

}  // namespace hybrid_slam
