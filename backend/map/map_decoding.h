#pragma once

#include "backend/map/map_file.h"
#include "backend/map/map_tables.h"
#include "backend/map/section_file.h"

namespace hybrid_slam {

// Reads what encode_map() wrote, of which nothing is trusted: ids, indices and counts are in range
// afterwards, numbers are finite, and what follows from other parts (the keyframes' landmarks,
// covisibility, children, landmarks' descriptors) is made anew. Whether all this is a consistent
// map is left to Map::check_consistency(). Throws InputError.
MapTables decode_map(SectionFileReader& file, MapFileInfo& info);

}  // namespace hybrid_slam
