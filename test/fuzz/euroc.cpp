#include <filesystem>

#include "frontend/input/image_sequence.h"
#include "test/fuzz/fuzz_target.h"

// The csv files of a sequence in EuRoC's layout: images of left and right, truth. Its two images
// and its calibration stay.
namespace hybrid_slam {
namespace {

constexpr char kSensor[] =
    "T_BS: {rows: 4, cols: 4, data: [1, 0, 0, %s, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}\n"
    "resolution: [8, 6]\nintrinsics: [8, 8, 3.5, 2.5]\ncamera_model: pinhole\n"
    "distortion_model: radial-tangential\ndistortion_coefficients: [-0.1, 0.01, 0, 0]\n";

bool write_sequence() {
  for (const auto& [camera, x] : {std::pair("cam0", "0.0"), std::pair("cam1", "0.1")}) {
    std::filesystem::create_directories(fuzz_folder() / camera / "data");
    std::string sensor = kSensor;
    sensor.replace(sensor.find("%s"), 2, x);
    input_file(sensor, std::string(camera) + "/sensor.yaml");
    for (const char* const name : {"1000000000", "1100000000"}) {
      input_file("P5 8 6 255\n" + std::string(48, 'g'),
                 std::string(camera) + "/data/" + name + ".pgm");
    }
  }
  std::filesystem::create_directories(fuzz_folder() / "state_groundtruth_estimate0");
  return true;
}

}  // namespace

void read_input(std::string_view input) {
  static const bool is_there = write_sequence();
  static_cast<void>(is_there);
  input_files(input, {"cam0/data.csv", "cam1/data.csv", "state_groundtruth_estimate0/data.csv"});
  const auto sequence = open_sequence(fuzz_folder().string(), SequenceLayout::kEuroc, "");
  for (std::size_t i = 0; i < std::min<std::size_t>(2, sequence->size()); ++i) {
    try_reading([&] { sequence->read(i); });
  }
}

}  // namespace hybrid_slam
