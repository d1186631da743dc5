#include "cameras/calibration/calibration_file.h"
#include "test/fuzz/fuzz_target.h"

void hybrid_slam::read_input(std::string_view input) {
  const std::string path = input_file(input).string();
  std::vector<std::string> warnings;
  try_reading([&] { read_fisheye(path, &warnings); });
  try_reading([&] { read_kalibr_camchain(path); });
}
