#pragma once

#include <filesystem>

#include "apps/map_tool/image_names.h"

namespace hybrid_slam {

// A component as nerfstudio reads it: transforms.json with the images of stereo pairs and other
// pinhole cameras, transforms_fisheye.json with those of fisheyes (a file has one camera model),
// points.ply. `images` is where ImageNames::write_rectified() put what it wrote. Throws InputError
// for other camera models, and OutputError.
void export_nerfstudio(const MapSnapshot& map, KeyframeId component, const ImageNames& names,
                       const std::filesystem::path& images, const std::filesystem::path& folder);

}  // namespace hybrid_slam
