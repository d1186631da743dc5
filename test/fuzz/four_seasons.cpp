#include <filesystem>

#include "frontend/input/image_sequence.h"
#include "test/fuzz/fuzz_target.h"

// The text files of a recording in 4Seasons' layout: times, truth, calibration. Its two pairs of
// images stay.
namespace hybrid_slam {
namespace {

bool write_images() {
  for (const char* const camera : {"cam0", "cam1"}) {
    const std::string folder = "undistorted_images/" + std::string(camera);
    std::filesystem::create_directories(fuzz_folder() / folder);
    for (const char* const name : {"1000000001000000000", "1000000001100000000"}) {
      input_file("P5 8 6 255\n" + std::string(48, 'g'), folder + "/" + name + ".pgm");
    }
  }
  std::filesystem::create_directories(fuzz_folder() / "calibration");
  return true;
}

}  // namespace

void read_input(std::string_view input) {
  static const bool is_there = write_images();
  static_cast<void>(is_there);
  input_files(input,
              {"times.txt", "GNSSPoses.txt", "calibration/undistorted_calib_0.txt",
               "calibration/undistorted_calib_1.txt", "calibration/undistorted_calib_stereo.txt"});
  const auto sequence = open_sequence(fuzz_folder().string(), SequenceLayout::kFourSeasons, "");
  for (std::size_t i = 0; i < std::min<std::size_t>(2, sequence->size()); ++i) {
    try_reading([&] { sequence->read(i); });
  }
}

}  // namespace hybrid_slam
