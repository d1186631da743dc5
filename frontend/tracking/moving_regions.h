#pragma once

#include <span>
#include <vector>

#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"
#include "frontend/matching/circular_match.h"
#include "frontend/matching/stereo_matcher.h"

namespace hybrid_slam {

// A feature that was followed between two frames, at its place in the later one.
struct FollowedFeature {
  double x = 0;  // [px]
  double y = 0;
  bool moves = false;  // against the scene
};

// What `matches` between two stereo frames say of things that move by themselves, given the motion
// of the camera. A match says nothing where the camera's motion hardly displaced the image: there,
// what stands still in the scene and what stands still before the camera look alike. Between
// agreement and a clear contradiction lies what calibration and noise may be blamed for: left out,
// too.
std::vector<FollowedFeature> followed_features(const Calibrated<RectifiedStereo>& camera,
                                               const StereoFeatures& previous,
                                               const StereoFeatures& current,
                                               std::span<const CircularMatch> matches,
                                               const Rigid3d& current_from_previous);

// Where in a camera's image things move by themselves: the arm, a tool, fish, the shadow of the
// vehicle. They are found by what contradicts the motion of the camera in the same place again and
// again, more often than wrong matches do all over the image, without any mask given.
class MovingRegions {
 public:
  // Of an image of this size [px].
  MovingRegions(int width, int height);

  // Two frames `seconds` apart. What was seen before fades within about two seconds of such time.
  void add(double seconds, std::span<const FollowedFeature> features);

  // Whether the place is in such a region.
  bool contains(double x, double y) const;

  // Of the image.
  double share() const;

 private:
  struct Evidence {
    double still = 0;
    double moving = 0;
  };

  std::size_t cell_of(double x, double y) const;
  Evidence around(int column, int row) const;
  void judge();

  double cell_;  // [px]
  int columns_;
  int rows_;
  std::vector<Evidence> evidence_;  // of each cell, row by row
  std::vector<char> moves_;         // likewise
};

}  // namespace hybrid_slam
