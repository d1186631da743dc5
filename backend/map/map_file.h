#pragma once

#include <filesystem>
#include <string>

#include "backend/map/map.h"

namespace hybrid_slam {

// What a map file says besides the map. Free text.
struct MapFileInfo {
  std::string program;  // and its version
  std::string options;  // with which the map was made
};

struct LoadedMap {
  Map map;
  MapFileInfo info;
};

// Writes the map into a file, whole or not at all (cameras/files/output_file.h); docs/map_file.md
// tells what is where. The same map gives the same bytes. Needs a few megabytes of memory, whatever
// the size of the map. Throws OutputError.
void save_map(const std::filesystem::path& path, const MapSnapshot& map, const MapFileInfo& info);

// The map as it was saved: whatever is done to it from here on has the same outcome as with the one
// that was never saved, ids included. Throws InputError, one line with file, section and reason,
// for a file that is cut off, damaged or of another version, and for one whose content is no
// consistent map (Map::check_consistency() and the ranges of all values): nothing is loaded in
// part.
LoadedMap load_map(const std::filesystem::path& path);

}  // namespace hybrid_slam
