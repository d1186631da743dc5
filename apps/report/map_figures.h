#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Residuals in one part of a camera's image: projection minus measurement of (u, v) [px].
struct ResidualCell {
  std::size_t count = 0;
  double mean_u = 0;
  double mean_v = 0;
  double rms = 0;  // per coordinate, of u and v
};

// What the observations of one camera leave over once the map is optimised.
struct CameraResiduals {
  static constexpr int kColumns = 16;

  CameraId camera;
  bool stereo = false;
  int width = 0;  // of the image [px]
  int height = 0;
  std::size_t observations = 0;
  std::size_t behind = 0;          // of landmarks that the camera cannot see
  double rms_px = kUnknown;        // per coordinate of (u, v)
  double rms_right_px = kUnknown;  // of u in the right image, where it is measured
  double assumed_px = kUnknown;    // median of the standard deviations that are assumed
  // In standard deviations: 1 where the measurements are as good as assumed, a little less since
  // the map was fitted to them. Root of mean square, and median, per coordinate.
  double rms_sigmas = kUnknown;
  double median_sigmas = kUnknown;
  int rows = 0;                     // of cells, as square as they go
  std::vector<ResidualCell> cells;  // row by row, kColumns each
};

struct LandmarkFigures {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // in the world [m]
  bool stereo = false;                              // found by a stereo pair
  std::size_t views = 0;                            // keyframes that see it
  double born = 0;                                  // time of the keyframe that found it [s]
  // How certain the point is where the poses are taken for exact: root of the trace of the inverse
  // of what its observations tell [m]. Infinite where one direction is not measured.
  double sigma = 0;
};

struct KeyframeFigures {
  KeyframeId id;
  bool stereo = false;
  double time = 0;  // [s]
  KeyframeId component;
  Rigid3d world_from_cam;
  std::vector<std::uint32_t> seen;  // its landmarks, by their places in MapFigures::landmarks
  double distance = kUnknown;       // median of those of its landmarks along its axis [m]; of a
                                    // fisheye, along the ray
  double resolution = kUnknown;     // size of a pixel at that distance [mm/px]
  double rms_sigmas = kUnknown;     // of its residuals
};

// What a map's observations tell of how good it is.
struct MapFigures {
  std::vector<CameraResiduals> cameras;
  std::vector<LandmarkFigures> landmarks;  // ascending by id
  std::vector<KeyframeFigures> keyframes;  // ascending by id
};

MapFigures map_figures(const MapSnapshot& map);

// For summary.json, "residuals": per camera. And "landmark_sigma_mm": median and p95.
nlohmann::ordered_json residuals_json(const MapFigures& figures);
nlohmann::ordered_json landmark_sigma_json(const MapFigures& figures);

// keyframes.csv and residuals.csv; docs/report.md has the columns. Throws OutputError.
void write_keyframes(const std::filesystem::path& path, const MapFigures& figures);
void write_residuals(const std::filesystem::path& path, const MapFigures& figures);

// Of a sorted copy; NaN where there are none. `share` in 0..1.
double quantile(std::vector<double> values, double share);

}  // namespace hybrid_slam
