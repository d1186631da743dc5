#include <CLI/CLI.hpp>
#include <string>
#include <utility>
#include <vector>

#include "apps/map_tool/verbs.h"
#include "apps/program/program.h"
#include "backend/problem/solver_log.h"

namespace hybrid_slam {
namespace {

constexpr const char* kFooter =
    R"(MAP is a map file (.hslam) as hybrid_slam writes it; it is never changed. docs/map_tool.md tells more.

Exit codes: 0 done, of verify: sound; 1 internal error; 2 bad usage; 3 an input cannot be read or an
output not be written; 4 verify: read, but unsound; 130 interrupted, nothing is written. view ends with Ctrl-C: 0.)";

int run(int argc, char** argv) {
  CLI::App app("Looks into maps and runs; checks, cuts, exports and merges maps.", "map_tool");
  app.footer(kFooter);
  app.require_subcommand(1);
  // A further verb: its function in verbs.h, and a line here.
  const std::vector<std::pair<std::string, Verb>> verbs{
      {"info", add_info(app)},     {"verify", add_verify(app)}, {"crop", add_crop(app)},
      {"export", add_export(app)}, {"merge", add_merge(app)},   {"report", add_report(app)},
      {"view", add_view(app)}};
  if (const auto end = parse_line(app, argc, argv)) return *end;
  for (const auto& [name, verb] : verbs) {
    if (app.got_subcommand(name)) return verb();
  }
  return kExitBadUsage;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  using namespace hybrid_slam;
  return run_program("map_tool", [&] {
    silence_solver_log();
    return run(argc, argv);
  });
}
