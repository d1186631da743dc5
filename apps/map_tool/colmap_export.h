#pragma once

#include "apps/io/graphs/colmap_model.h"
#include "apps/map_tool/image_names.h"

namespace hybrid_slam {

// What could not be said in a COLMAP model.
struct ColmapLosses {
  std::size_t behind = 0;  // observations of a fisheye at 90 degrees or more from its axis: COLMAP
                           // projects what lies in front of the plane z = 0 only
};

// A component of a map as a COLMAP model with rigs and frames (COLMAP 3.12 and later). A stereo
// pair is a rig of two PINHOLE cameras, the left one its reference, the right one moved by the
// baseline along x; a fisheye (OPENCV_FISHEYE) or another camera is a rig of its own. A keyframe is
// a frame; a stereo keyframe has two images, the right one with the keypoints that have a right
// match, in the row of the left ones. Pixels count from the image's corner, as COLMAP's do. The
// world is ours. Throws InputError, without a file's name, for a camera that COLMAP has no model
// of.
ColmapModel make_colmap_model(const MapSnapshot& map, KeyframeId component, const ImageNames& names,
                              ColmapVariant variant, ColmapLosses& losses);

}  // namespace hybrid_slam
