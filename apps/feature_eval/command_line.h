#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/feature_eval/feature_method.h"
#include "apps/feature_eval/study/study.h"

namespace hybrid_slam {

enum class EvalCommand { kExtract, kMatch, kStudy };

// What the user asked for.
struct CommandLine {
  EvalCommand command = EvalCommand::kExtract;
  std::vector<std::string> images;
  FeatureEngine engine = FeatureEngine::kCpu;
  SiftOptions sift;
  int threads = 1;  // images, or pairs, at a time
  int repeat = 1;   // runs of each; the median of their times counts
  std::string out = "out";
  std::string json;  // empty: none

  StudyOptions study;  // of kStudy, which takes none of the above
};

// Reads the command line. Empty if the program shall end at once with `exit_code` (help, bad usage
// or an engine that cannot be used, which have been reported).
std::optional<CommandLine> parse_command_line(int argc, char** argv, int& exit_code);

}  // namespace hybrid_slam
