#include "frontend/input/camera_poses.h"
#include "frontend/input/trajectory_file.h"
#include "test/fuzz/fuzz_target.h"

void hybrid_slam::read_input(std::string_view input) {
  const std::filesystem::path path = input_file(input);
  for (const auto order :
       {QuaternionOrder::kUnknown, QuaternionOrder::kXyzw, QuaternionOrder::kWxyz}) {
    try_reading([&] { read_trajectory(path, order); });
  }
  try_reading([&] { read_euroc_poses(path); });
  for (const auto convention : {TruthConvention::kAuto, TruthConvention::kCamFromWorld}) {
    try_reading([&] { read_camera_poses(path, {0, 0.5, 1, 1.5}, convention); });
  }
}
