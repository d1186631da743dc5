#include "test/fuzz/written_graph.h"

#include <cstdio>
#include <cstdlib>

namespace hybrid_slam {

void check_written(const GraphFile& file) {
  if (const std::string wrong = file.graph.validate(); !wrong.empty()) {
    std::fprintf(stderr, "a graph was read that is none: %s\n", wrong.c_str());
    std::abort();
  }
  const std::filesystem::path folder = fuzz_folder() / "written";
  std::filesystem::create_directories(folder);
  file.writers.at(0).write(file.graph, folder);
}

}  // namespace hybrid_slam
