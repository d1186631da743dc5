#pragma once

#include <span>
#include <string>
#include <vector>

#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

// When a view adds nothing: nearly all landmarks in it are seen by enough keyframes already, at the
// same or a finer scale (ORB-SLAM's rule). Such a keyframe is taken out of the map again, and a
// frame that would be such a one does not become it.
struct RedundancyOptions {
  double share = 0.9;  // of the landmarks in view
  int observers = 3;   // keyframes

  std::string validate() const;
};

// The size of a keypoint's image, comparable between cameras: its scale over the focal length.
double normalized_scale(const Camera& camera, const Keypoint& keypoint);

// Whether enough keyframes, all but those `left_out`, see the landmark at this normalized scale or
// a finer one.
bool is_well_seen(const MapSnapshot& map, const Landmark& landmark, double scale, int observers,
                  const std::vector<KeyframeId>& left_out = {});

// A landmark in view, and the normalized scale at which the view shows it.
struct LandmarkInView {
  const Landmark* landmark = nullptr;
  double scale = 0;
};

// Whether more than the share of what is in view is well seen: of these landmarks, and of so many
// `others` that nobody sees. Looks no further than it has to.
bool is_redundant(const MapSnapshot& map, std::span<const LandmarkInView> landmarks, int others,
                  const RedundancyOptions& options, const std::vector<KeyframeId>& left_out = {});

}  // namespace hybrid_slam
