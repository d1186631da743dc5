#include "frontend/input/footage_calibration.h"
#include "test/fuzz/fuzz_target.h"

// One file of a pair, or two, one for each camera.
void hybrid_slam::read_input(std::string_view input) {
  const auto paths = input_files(input, {"left", "right"});
  std::vector<std::string> files{paths[0].string()};
  if (input.find(kNextFile) != input.npos) files.push_back(paths[1].string());
  for (const bool color : {false, true}) {
    try_reading([&] { read_pair_calibration(files, color, {1024, 768}); });
  }
}
