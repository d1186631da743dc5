#include "frontend/input/bags/bag.h"

#include "frontend/input/bags/bag_sequence.h"
#include "frontend/input/bags/messages.h"
#include "test/fuzz/fuzz_target.h"

// A bag by itself, and as a sequence. Which format is fuzzed is up to the seeds.
void hybrid_slam::read_input(std::string_view input) {
  const std::filesystem::path path = input_file(input);
  try_reading([&] {
    const auto bag = open_bag(path);
    for (const BagMessage& message : bag->messages()) {
      try_reading([&] { bag->read(message, kStampBytes); });
      try_reading([&] { bag->read(message); });
    }
  });
  const auto sequence = open_bags({path.string()}, SequenceCameras::kAuto, {}, {});
  for (std::size_t i = 0; i < sequence->size(); ++i) {
    try_reading([&] { sequence->read(i); });
  }
}
