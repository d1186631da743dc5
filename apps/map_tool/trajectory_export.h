#pragma once

#include <filesystem>

#include "apps/map_tool/map_export.h"

namespace hybrid_slam {

// The trajectories of a component's keyframes, a file per camera and dive. See export_map().
void export_trajectories(const MapSnapshot& map, KeyframeId component, ExportFormat format,
                         const std::filesystem::path& folder);

}  // namespace hybrid_slam
