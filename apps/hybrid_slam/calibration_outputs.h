#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "backend/map/map_snapshot.h"
#include "frontend/calibration/lens_error.h"
#include "frontend/calibration/rig_calibrator.h"

namespace hybrid_slam {

// What a run's residuals say of the calibration of its cameras.
struct CalibrationFigures {
  std::vector<ResidualMap> maps;  // by camera, of all its keyframes
  std::vector<SystematicPart> systematic;
  RigFindings rig;
  std::optional<LensError> lens;     // of the stereo pair
  bool stereo = false;               // `rig` says something
  std::vector<std::string> reasons;  // why the rig should be calibrated again; empty: it need not
  // In what the rig is another one than that of the map which the run went on with.
  std::vector<std::string> changes;
};

// `rig` may be null.
CalibrationFigures calibration_figures(const MapSnapshot& map, const RigFindings* rig);

// For summary.json, "calibration".
nlohmann::ordered_json to_json(const CalibrationFigures& figures);

// calibration.csv; docs/calibration.md has the columns. Throws OutputError.
void write_calibration(const std::filesystem::path& path, const MapSnapshot& map,
                       const CalibrationFigures& figures);

}  // namespace hybrid_slam
