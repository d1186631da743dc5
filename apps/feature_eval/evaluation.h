#pragma once

#include <string>
#include <utility>
#include <vector>

#include "apps/feature_eval/command_line.h"
#include "apps/io/stage_times.h"

namespace hybrid_slam {

struct ExtractionResult {
  std::string image;  // as it was named
  int width = 0;      // [px]
  int height = 0;     // [px]
  std::size_t keypoints = 0;
  StageTimes times;  // of each run
};

struct MatchResult {
  std::string first, second;
  std::size_t matches = 0;
  StageTimes times;  // of each run
};

struct Evaluation {
  std::vector<ExtractionResult> images;  // in the order given
  std::vector<MatchResult> pairs;        // the first image with each other one; of kMatch
};

// Does what was asked for, and writes pictures and CSVs. Throws InputError for an image that cannot
// be read, before any work where its file's structure tells; OutputError.
Evaluation evaluate(const CommandLine& line);

}  // namespace hybrid_slam
