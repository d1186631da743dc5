#pragma once

#include <array>
#include <filesystem>
#include <string>

#include "cameras/geometry/rigid3d.h"
#include "frontend/input/rectification.h"

namespace hybrid_slam {

struct EurocCamera {
  RawCamera camera;
  Rigid3d body_from_cam;
  std::string source;  // the file that says it
  std::string note;    // how a lens of another model was taken; else empty
};

// A camera's sensor.yaml. Throws InputError.
EurocCamera read_euroc_sensor(const std::filesystem::path& path);

// The first two cameras of a Kalibr camchain. The body is the chain's IMU or, without one, the left
// camera. Throws InputError.
std::array<EurocCamera, 2> read_camchain_pair(const std::filesystem::path& path);

// The first two cameras of Basalt's JSON; the body is the IMU. Throws InputError.
std::array<EurocCamera, 2> read_basalt_pair(const std::filesystem::path& path);

// Left and right of a sequence: cam{0,1}/sensor.yaml in the folder `mav` or, where there are none,
// the first two cameras of a Kalibr camchain (camchain*.yaml in dso/, as TUM-VI has it, or in the
// sequence's folder or mav). Throws InputError.
std::array<EurocCamera, 2> read_euroc_cameras(const std::filesystem::path& folder,
                                              const std::filesystem::path& mav);

}  // namespace hybrid_slam
