#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

enum class ExportFormat { kColmap, kColmapBinary, kNerfstudio, kTum, kKitti, kEuroc, kPly };

struct ExportOptions {
  ExportFormat format = ExportFormat::kColmap;
  std::filesystem::path out;          // a folder, made if missing
  std::vector<std::string> datasets;  // of the images, one per dive
};

// Writes a map as other programs read it. The component with most keyframes goes into `out`, each
// other one, whose place against it is not known, into `out`/component_NAME. Returns what is to be
// told, one line each. Throws InputError and OutputError.
//   colmap, colmap-binary   see colmap_export.h; rectified images, where the dataset's are raw,
//   into
//                           images/
//   nerfstudio              transforms.json (the stereo pair's images) and transforms_fisheye.json:
//                           world_from_cam with x right, y up, z backwards; points.ply
//   tum, kitti, euroc       stereo.* and fisheye.*, one line per keyframe, world_from_cam; kitti
//   has
//                           the times beside it. Of a camera of several dives, or the second of its
//                           kind, "stereo_run2" and "stereo2"
//   ply                     map.ply: landmarks and keyframes, as hybrid_slam writes it
std::vector<std::string> export_map(const MapSnapshot& map, const ExportOptions& options);

}  // namespace hybrid_slam
