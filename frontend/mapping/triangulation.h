#pragma once

#include <string>

#include "backend/map/map_edit.h"
#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

struct TriangulationOptions {
  int stereo_neighbours = 10;            // covisible keyframes to match with, for a stereo keyframe
  int mono_neighbours = 20;              // and for one of a single camera
  double min_baseline_ratio = 0.01;      // baseline over the scene's median depth
  double max_parallax_cosine = 0.9998;   // without stereo, rays must differ by more than this
  double max_descriptor_distance = 0.6;  // L2 between unit descriptors
  double ratio = 0.8;                    // best against second best along the epipolar line
  double epipolar_sigmas = 2.5;          // width of the epipolar band
  double max_scale_ratio = 1.7;          // between the object-space sizes seen by both
  double chi2_mono = 5.991;
  double chi2_stereo = 7.815;

  std::string validate() const;
};

// New landmarks from the keypoints of a keyframe that have none yet, matched with those of its
// covisible neighbours along epipolar planes. Bearings throughout: any two cameras can be paired.
// Depth comes from the two views, or from a stereo pair where its parallax is larger.
MapEdit triangulate_with_neighbours(const MapSnapshot& map, KeyframeId keyframe,
                                    const TriangulationOptions& options);

}  // namespace hybrid_slam
