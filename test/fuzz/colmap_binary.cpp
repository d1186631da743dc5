#include "apps/io/graphs/colmap.h"

#include "test/fuzz/written_graph.h"

void hybrid_slam::read_input(std::string_view input) {
  input_files(input, {"cameras.bin", "images.bin", "points3D.bin", "rigs.bin", "frames.bin"});
  check_written(read_colmap(fuzz_folder(), ColmapVariant::kBinary));
}
