#include "frontend/input/footage_calibration.h"
#include "test/fuzz/fuzz_target.h"

// One file of a pair, or one for each camera, or a third of how they stand.
void hybrid_slam::read_input(std::string_view input) {
  const auto paths = input_files(input, {"left", "right", "between"});
  std::vector<std::string> files{paths[0].string()};
  for (std::size_t at = input.find(kNextFile); at != input.npos && files.size() < paths.size();
       at = input.find(kNextFile, at + kNextFile.size())) {
    files.push_back(paths[files.size()].string());
  }
  for (const bool color : {false, true}) {
    try_reading([&] { read_pair_calibration(files, color, {1024, 768}); });
  }
}
