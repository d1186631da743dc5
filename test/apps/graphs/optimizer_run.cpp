#include "test/apps/graphs/optimizer_run.h"

#include <algorithm>

#include <catch2/catch.hpp>

namespace hybrid_slam {

Outcome run_optimizer(const TempFolder& folder, const std::vector<std::string>& arguments) {
  return run_program(MAP_OPTIMIZER, arguments, folder.path());
}

Json report_of(const TempFolder& folder, const std::string& out) {
  return Json::parse(read_text(folder.path() / out / "report.json"));
}

void check_refused(const Outcome& outcome, int code, const std::string& reason) {
  CAPTURE(outcome.err);
  CHECK(outcome.code == code);
  CHECK(outcome.out.empty());
  CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
  CHECK_THAT(outcome.err, Catch::StartsWith("map_optimizer: "));
  CHECK_THAT(outcome.err, Catch::Contains(reason));
}

}  // namespace hybrid_slam
