#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "backend/map/features.h"
#include "backend/map/map_snapshot.h"
#include "frontend/matching/keypoint_grid.h"

namespace hybrid_slam {

// The features of one image as the searches below see them.
struct FeatureView {
  const Camera& camera;
  const FeatureSet& features;
  const std::vector<float>& u_right;  // empty for a mono camera
  const KeypointGrid& grid;
};

// How a camera at a given pose would see a landmark.
struct LandmarkPrediction {
  LandmarkId id;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // [px]
  double u_right = 0;                               // [px]; NaN unless the camera is a stereo pair
  double scale = 0;                                 // of the keypoint [px], from the distance
  double view_cosine = 1;                           // to the landmark's mean viewing direction
};

struct ProjectionMatcherOptions {
  double radius = 7;              // [px] for keypoints of scale 1.6 and finer
  double max_scaled_radius = 40;  // [px]; the radius grows with the predicted scale up to this
  double max_descriptor_distance = 0.7;  // L2 between unit descriptors
  double ratio = 0.8;                    // best against second best at a similar scale
  double max_scale_ratio = 1.7;          // between predicted and observed scale, either way
  double max_view_angle_deg = 60;        // to the mean viewing direction

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// A keypoint found for a landmark.
struct ProjectionMatch {
  LandmarkId landmark;
  int keypoint = 0;
  double descriptor_distance = 0;
};

// The landmarks of `ids` that a camera at this pose would see: in front of it, inside the image and
// from a direction not too far from the ones known. In the order of `ids`; unknown ids are left
// out.
std::vector<LandmarkPrediction> predict_landmarks(const MapSnapshot& map, const Camera& camera,
                                                  const Rigid3d& cam_from_world,
                                                  std::span<const LandmarkId> ids,
                                                  double max_view_angle_deg);

// For each prediction the best keypoint inside its window, by descriptor, at a similar scale and
// with a consistent right coordinate. A keypoint goes to the landmark that fits it best; keypoints
// for which `taken` (null, or one per keypoint) is non-zero are left alone. Ascending by keypoint.
std::vector<ProjectionMatch> match_predictions(const MapSnapshot& map, const FeatureView& view,
                                               std::span<const LandmarkPrediction> predictions,
                                               const std::vector<char>* taken,
                                               const ProjectionMatcherOptions& options);

// How often the descriptors of a landmark and of a keypoint that have nothing to do with one
// another are near enough for a match: counted among some hundred arbitrary pairs, at least one of
// which counts. What the ratio and the scale reject besides is not in it.
double accidental_match_rate(const MapSnapshot& map, const FeatureView& view,
                             std::span<const LandmarkPrediction> predictions,
                             const ProjectionMatcherOptions& options);

}  // namespace hybrid_slam
