#include "apps/io/graphs/stereo_stream.h"

#include "test/fuzz/written_graph.h"

void hybrid_slam::read_input(std::string_view input) {
  check_written(read_stereo_stream(input_file(input)));
}
