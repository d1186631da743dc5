#pragma once

#include <string_view>

#include "backend/map/map.h"
#include "backend/map/section_file.h"

namespace hybrid_slam {

inline constexpr SectionFileFormat kMapFileFormat{"\x89HSLMAP\n", 5, "map file", 2};

// The sections in their order. The first three kinds come once; the others as often as it takes.
inline constexpr std::string_view kInfoSection = "info";
inline constexpr std::string_view kCamerasSection = "cameras";
inline constexpr std::string_view kStateSection = "state";
inline constexpr std::string_view kCorrectionsSection = "corrections";  // since version 5
inline constexpr std::string_view kKeyframesSection = "keyframes";
inline constexpr std::string_view kOdometrySection = "odometry";  // since version 3
inline constexpr std::string_view kErasedSection = "erased";
inline constexpr std::string_view kLandmarksSection = "landmarks";
inline constexpr std::string_view kSectionOrder[] = {
    kInfoSection,      kCamerasSection,  kStateSection,  kCorrectionsSection,
    kKeyframesSection, kOdometrySection, kErasedSection, kLandmarksSection};

// The one door to the tables for what stores a map, makes one from stored tables, or changes what
// was measured.
struct MapFileAccess {
  static const MapTables& tables(const MapSnapshot& map) { return map.tables_; }
  static MapTables& tables(Map& map) { return map.view_.tables_; }
  static Map make(MapTables tables) {
    Map map;
    map.view_.tables_ = std::move(tables);
    return map;
  }
};

}  // namespace hybrid_slam
