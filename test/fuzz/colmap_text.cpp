#include "apps/io/graphs/colmap.h"

#include "test/fuzz/written_graph.h"

void hybrid_slam::read_input(std::string_view input) {
  input_files(input, {"cameras.txt", "images.txt", "points3D.txt", "rigs.txt", "frames.txt"});
  check_written(read_colmap(fuzz_folder(), ColmapVariant::kText));
}
