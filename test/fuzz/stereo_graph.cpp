#include "apps/io/graphs/stereo_graph.h"

#include "test/fuzz/written_graph.h"

void hybrid_slam::read_input(std::string_view input) {
  const auto paths =
      input_files(input, {"calibration.txt", "camera_poses.txt", "stereo_factors.txt"});
  check_written(read_stereo_graph(paths.back()));
}
