#include "apps/io/graphs/g2o.h"

#include "test/fuzz/written_graph.h"

void hybrid_slam::read_input(std::string_view input) { check_written(read_g2o(input_file(input))); }
