#pragma once

#include <string>

#include "apps/slam/session_types.h"

// What is told of a frame: in frames.csv, and to who watches a run.

namespace hybrid_slam {

// Of a frame that has a pose.
struct PoseFigures {
  Rigid3d world_from_cam;
  Matrix6d covariance = Matrix6d::Zero();  // in ROS' order and axes, against the frame's base
  double sigma_position = 0;               // root of the trace of its position's block [m]
  double sigma_rotation_deg = 0;           // likewise of its turns [degrees]
};

PoseFigures pose_figures(const TrackedFrame& frame);

// "dark=13;few_features=0.02"; empty where nothing was found.
std::string causes_text(const FrameResult& frame);

}  // namespace hybrid_slam
