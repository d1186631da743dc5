#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

inline constexpr int kSurveyFrames = 8;
inline constexpr double kSurveyPeriod = 0.2;  // [s] between two frames

// The camera of the survey and its truth: a stereo pair that passes over blocks of several heights,
// turning a little.
Calibrated<RectifiedStereo> survey_camera();
Rigid3d survey_pose(int frame);  // world_from_cam, up to kSurveyFrames

// Writes the survey in KITTI's layout, sequence "00", with truth. Frames beyond kSurveyFrames go
// the way back, and forth again.
void write_kitti_survey(const std::filesystem::path& root, int frames = kSurveyFrames);

// A fisheye nearer to the ground, that turns by itself.
Calibrated<KannalaBrandt> survey_fisheye();
Rigid3d survey_fisheye_pose(int frame);  // world_from_cam

// In UWslam's hybrid layout, sequence "M1", with fisheye images.
void write_uwslam_survey(const std::filesystem::path& root, bool truth_as_cam_from_world);

// In EuRoC's layout, images with no distortion and no truth.
void write_euroc_survey(const std::filesystem::path& root);

// Image of KITTI's layout as written above.
std::filesystem::path kitti_image(const std::filesystem::path& root, bool right, int frame);

}  // namespace hybrid_slam
