#pragma once

#include "apps/io/graphs/graph_file.h"

namespace hybrid_slam {

// Stereo keyframes as a stream (.seq):
//   CAM f cx cy baseline SIGMA_PX s ODO_SIGMA_ROT r ODO_SIGMA_T t NKF n NLM m NOBS o
//   KF i GT <pose> [ODO <pose>] N count      poses: tx ty tz qx qy qz qw
//   landmark u_left u_right v                count lines
// GT is the true world_from_cam, ODO the measured previous_from_current. The first pose is fixed at
// its truth, the others start where odometry leads from there, and a landmark where the first
// observation with a positive disparity puts it. Observations are the factors; the camera is known.
// Times are the numbers of the keyframes.
//
// What is written has the motions of the estimate as its odometry. The format has no place for the
// landmarks: they are triangulated anew when it is read.
GraphFile read_stereo_stream(const std::filesystem::path& path);

}  // namespace hybrid_slam
