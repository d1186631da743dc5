#pragma once

#include <optional>
#include <string>

#include "apps/scene_renderer/dataset_writer.h"

namespace hybrid_slam {

// What the user asked for.
struct CommandLine {
  std::string out;
  std::string sequence;
  ImageFormat format = ImageFormat::kJpeg;
  SceneOptions options;
  int width = 1024;  // [px] of the stereo images
  int height = 768;
  int threads = 0;  // 0: one per core
  bool quiet = false;
};

// Reads the command line. Empty if the program shall end at once with `exit_code` (help, or bad
// usage, which has been reported).
std::optional<CommandLine> parse_command_line(int argc, char** argv, int& exit_code);

}  // namespace hybrid_slam
