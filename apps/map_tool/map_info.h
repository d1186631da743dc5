#pragma once

#include <map>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/map_tool/covered_area.h"
#include "apps/map_tool/map_residuals.h"
#include "backend/map/map_file.h"

namespace hybrid_slam {

struct TimeSpan {
  double first = 0;  // [s]
  double last = 0;
};

struct MapCameraInfo {
  Camera camera;
  RigCorrection correction;
  std::size_t keyframes = 0;
  std::size_t features = 0;   // that the map still holds
  std::size_t landmarks = 0;  // that it observes
  TimeSpan time;
  ResidualSummary residuals;
};

struct MapComponentInfo {
  KeyframeId name;                     // the keyframe that it began with
  std::vector<std::size_t> keyframes;  // by camera
  std::size_t landmarks = 0;
  double way = 0;       // from stereo keyframe to stereo keyframe [m]
  double distance = 0;  // median, from cameras to what they see [m]
  TimeSpan time;
  // Of the landmarks that three keyframes or more see; of all, if these are too few. The cells'
  // side is a twentieth of `distance`.
  CoveredArea area;
};

// Edges are pairs of keyframes, each counted once.
struct MapEdgeInfo {
  std::size_t covisible = 0;  // share a landmark
  std::size_t strong = 0;     // share 15 or more, which the rest of the program calls neighbours
  // Strong ones of one camera, of which the vehicle was away in between: some keyframe of that
  // camera between the two shares no landmark with either.
  std::size_t returns = 0;
  std::size_t odometry = 0;
  std::size_t loose = 0;  // odometry of which nothing is known: between components
  std::size_t kept =
      0;  // keyframes exempt from culling: origin, begins of components, ends of loops
};

struct MapInfo {
  MapFileInfo file;
  std::size_t keyframes = 0, landmarks = 0, observations = 0;
  std::size_t erased_keyframes = 0;
  std::vector<MapCameraInfo> cameras;        // by their id
  std::vector<MapComponentInfo> components;  // by their name
  MapEdgeInfo edges;
};

MapInfo map_info(const MapSnapshot& map, const MapFileInfo& file);

// For people, several lines.
std::string to_text(const MapInfo& info);

nlohmann::ordered_json to_json(const MapInfo& info);

// What was found out about a camera, a line each; nothing of most.
std::vector<std::string> correction_lines(const RigCorrection& correction);

// The names of a model's parameters, in their order.
std::vector<std::string> parameter_names(const Camera& camera);

}  // namespace hybrid_slam
