#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/report/coverage.h"
#include "apps/report/map_figures.h"
#include "apps/report/moments.h"
#include "apps/report/run_story.h"

namespace hybrid_slam {

// All that a report tells of a run.
struct ReportContent {
  std::string title;
  nlohmann::ordered_json summary;  // summary.json; null where there is none
  nlohmann::ordered_json timing;   // timing.json; likewise
  RunStory story;
  ResultTable loops;
  ResultTable errors;
  ResultTable calibration;
  MapFigures figures;
  Coverage coverage;
  std::vector<Camera> cameras;  // of the map
  std::string map_options;      // with which the map was made: MapFileInfo::options
  std::string map_program;
  std::vector<MomentPicture> pictures;
};

// The page's data as JSON, at most `bytes` long. What is too much is thinned, and the data say so:
// frames to every n-th, with all that changed the state; keyframes and landmarks evenly.
std::string report_data(const ReportContent& content, std::size_t bytes);

}  // namespace hybrid_slam
