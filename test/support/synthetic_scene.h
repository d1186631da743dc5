#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "backend/map/frame_observations.h"
#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

enum class SceneTrajectory {
  kCorridor,  // forward between walls and over a floor, 0.5 m baseline, points 4 to 40 m away
  kHover,     // nearly in place, 3 m above a seafloor with relief
  kOrbit,     // a closed circle of 3 m radius, 3 m above that seafloor
};

Calibrated<RectifiedStereo> synthetic_stereo_camera(double baseline);
Calibrated<KannalaBrandt> synthetic_fisheye_camera();

struct SyntheticSceneOptions {
  SceneTrajectory trajectory = SceneTrajectory::kOrbit;
  int times = 20;          // moments, each with a frame of every camera
  double frame_rate = 10;  // [Hz]
  double step = 0;  // way between moments [m]; 0: 0.4 corridor, 0.02 hover, full circle orbit
  bool stereo = true;
  bool fisheye = false;              // moves on its own, about 1 m in front of the stereo pair
  int landmarks = 2000;              // in the whole scene
  double noise = 0.25;               // keypoint's standard deviation per pixel of its scale [-]
  double outlier_rate = 0;           // share of keypoints far from where their landmark projects
  double missing_right_rate = 0.05;  // share of stereo keypoints without a right match
  int clutter = 0;                   // keypoints per frame that belong to no landmark
  double descriptor_noise = 8;       // standard deviation of each byte
  std::uint64_t seed = 1;
};

struct SyntheticFrame {
  std::shared_ptr<const FrameObservations> observations;  // in no particular order of landmarks
  Rigid3d cam_from_world;                                 // truth
  std::vector<int> landmark;  // one per keypoint: index of the scene's landmark; -1 for clutter
  std::vector<char> outlier;  // one per keypoint: a wrong match, its position is not the landmark's
};

// A scene of which everything is known. The world is the camera of the first frame, which is the
// stereo pair's unless there is none. Landmarks have an object size, so that scales agree with
// distances, and a descriptor of their own (DescriptorKind::kSynthetic).
struct SyntheticScene {
  SyntheticSceneOptions options;
  std::vector<Camera> cameras;         // CameraId counts in this order: stereo, fisheye
  std::vector<SyntheticFrame> frames;  // by time; at the same time stereo before fisheye
  std::vector<Eigen::Vector3d> points_in_world;
  std::vector<Descriptor> descriptors;  // without noise
};

SyntheticScene make_synthetic_scene(const SyntheticSceneOptions& options);

}  // namespace hybrid_slam
