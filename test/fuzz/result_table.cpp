#include "apps/report/result_table.h"

#include "test/fuzz/fuzz_target.h"

void hybrid_slam::read_input(std::string_view input) {
  const ResultTable table(input_file(input));
  for (std::size_t row = 0; row < table.size(); ++row) {
    table.text(row, "state");
    table.number(row, "time");
  }
}
