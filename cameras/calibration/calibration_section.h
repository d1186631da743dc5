#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cameras/camera.h"
#include "cameras/files/yaml_section.h"

// What the readers of all formats share.
namespace hybrid_slam {

// The value as an image's width or height; `key` is where it stands. Throws InputError.
int image_size(const YamlSection& section, const std::string& key, double value);

// k: fx, fy, cx, cy. Width and height of 0 are unknown. Throws InputError.
void check_intrinsics(const YamlSection& section, const double* k, int width, int height,
                      const std::string& key);

// A lens as a file has it, as Kannala-Brandt.
struct FisheyeLens {
  Calibrated<KannalaBrandt> camera;
  std::string note;  // how it was taken, where it is of another model; may be empty
};

// A Kalibr camera, of a chain or alone: camera_model (pinhole if it is missing), intrinsics,
// distortion_model (equidistant if it is missing), distortion_coeffs, resolution. None unless it is
// a fisheye: pinhole with equidistant distortion, ds, eucm or omni. Throws InputError.
std::optional<FisheyeLens> read_kalibr_lens(const YamlSection& section);

// The one fisheye of a Kalibr camchain; lenses of other models are taken only where none is
// equidistant, which `notes` says. Throws InputError if there is none, or two of a kind.
FisheyeLens read_chain_fisheye(const YamlSection& chain, std::vector<std::string>& notes);

// The fisheye of Basalt's JSON, see basalt_file.h: camera_type kb4, ds or eucm. Throws InputError
// unless exactly one camera is one.
FisheyeLens read_basalt_lens(const YamlSection& file);

}  // namespace hybrid_slam
