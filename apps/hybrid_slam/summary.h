#pragma once

#include <nlohmann/json_fwd.hpp>

#include "apps/hybrid_slam/calibration_outputs.h"
#include "apps/hybrid_slam/outputs.h"
#include "apps/report/coverage.h"
#include "apps/report/map_figures.h"
#include "apps/report/run_story.h"

namespace hybrid_slam {

// What only the map tells, and what of it is shown in the report.
struct FigureTables {
  MapFigures figures;
  Coverage coverage;
  CalibrationFigures calibration;
  RunStory story;  // of the folder's files; empty if they are not whole
};

// The content of summary.json.
nlohmann::ordered_json summary_json(const CommandLine& line, const RunInput& input,
                                    const RunResult& result, const RunSummary& summary,
                                    const FigureTables& tables);

}  // namespace hybrid_slam
