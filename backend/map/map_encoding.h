#pragma once

#include "backend/map/map_file.h"
#include "backend/map/map_tables.h"
#include "backend/map/section_file.h"

namespace hybrid_slam {

// Adds all sections of a map, in their order.
void encode_map(const MapTables& tables, const MapFileInfo& info, SectionFileWriter& file);

}  // namespace hybrid_slam
