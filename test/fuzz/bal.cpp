#include "apps/io/graphs/bal.h"

#include "test/fuzz/written_graph.h"

void hybrid_slam::read_input(std::string_view input) { check_written(read_bal(input_file(input))); }
