#pragma once

#include "backend/map/map.h"

namespace hybrid_slam {

// All disparities of a stereo camera become larger by `by` [px]: what was found out about the
// camera holds for every keyframe that it made. Those that would be that of infinity or less become
// 0.1 px. Points follow by the disparity in their reference keyframe, the map as a whole (poses,
// odometry) by the median of them, about the world's origin: a start for an optimisation, which has
// to follow. Returns that median; 1, and nothing is done, if the map has no keyframe of the camera.
//
// `first`: keyframes before it were made by the camera as it was then; they stay as they are, and
// so do all poses.
double shift_disparities(Map& map, CameraId camera, double by, KeyframeId first = KeyframeId(0));

}  // namespace hybrid_slam
