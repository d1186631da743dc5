#include "apps/slam/slam_options.h"
#include "test/fuzz/fuzz_target.h"

void hybrid_slam::read_input(std::string_view input) {
  SlamOptions options = read_slam_options(input_file(input).string());
  options.distribute();
  // What was read can be written, and read again.
  read_slam_options(input_file(write_slam_options(options), "written").string());
}
