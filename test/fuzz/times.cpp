#include "frontend/input/footage_times.h"
#include "frontend/input/kitti_calibration.h"
#include "frontend/input/text_file.h"
#include "test/fuzz/fuzz_target.h"

void hybrid_slam::read_input(std::string_view input) {
  const std::filesystem::path path = input_file(input);
  std::vector<std::string> warnings;
  try_reading([&] { read_times(path, warnings); });
  try_reading([&] { read_kitti_timestamps(path); });
  try_reading([&] { times_by_file(path.string(), {"a/1.png", "a/2.png"}, {1, 2}, warnings); });
}
