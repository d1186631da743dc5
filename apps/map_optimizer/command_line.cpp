#include "apps/map_optimizer/command_line.h"

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <map>

#include "apps/program/program.h"

namespace hybrid_slam {
namespace {

constexpr const char* kFooter = R"(INPUT is told by its content:
  a BAL problem, a g2o pose graph (SE3), a COLMAP model (folder, text or binary), a stereo bundle
  problem in GTSAM's three files (the folder or the file of the factors), a stereo stream (.seq),
  a map file (.hslam)

Writes to DIR:
  optimized.txt, .g2o, .seq, .hslam or optimized/   the result in the format of the input
  optimized.tum   poses in time, world_from_cam, where the input has times
  updates.csv     time and cost of each update, of --problem incremental
  report.json     costs, errors, times, outliers by name

Exit codes: 0 done; 1 internal error; 2 bad usage; 3 bad input or output folder; 4 nothing to
optimise, or no solution; 130 interrupted, the estimate so far is saved.)";

const std::map<std::string, ProblemKind> kProblems{{"full", ProblemKind::kFull},
                                                   {"loop", ProblemKind::kLoop},
                                                   {"local", ProblemKind::kLocal},
                                                   {"incremental", ProblemKind::kIncremental}};

const std::map<std::string, Loss> kLosses{
    {"none", Loss::kNone}, {"huber", Loss::kHuber}, {"cauchy", Loss::kCauchy}};

const std::map<std::string, StartChoice> kStarts{{"auto", StartChoice::kAuto},
                                                 {"given", StartChoice::kGiven},
                                                 {"tree", StartChoice::kTree},
                                                 {"rotations", StartChoice::kRotations}};

std::map<std::string, GraphFormat> formats() {
  std::map<std::string, GraphFormat> names;
  for (const GraphFormat format : kGraphFormats) names.emplace(name_of(format), format);
  return names;
}

template <typename T>
CLI::Option* add_choice(CLI::App& app, const std::string& name, T& value,
                        const std::map<std::string, T>& choices, const std::string& text) {
  return app.add_option(name, value, text)
      ->transform(CLI::CheckedTransformer(choices).description(""))
      ->option_text("NAME");
}

}  // namespace

std::optional<CommandLine> parse_command_line(int argc, char** argv, int& exit_code) {
  CommandLine line;
  OptimizerOptions& options = line.options;
  GraphFormat format = GraphFormat::kBal;
  Loss loss = Loss::kNone;
  std::string frame;

  CLI::App app("Optimises a map, a bundle adjustment problem or a pose graph.", "map_optimizer");
  app.footer(kFooter);
  app.add_option("INPUT", line.input, "file or folder")->required();
  add_choice(app, "--problem", options.problem, kProblems,
             "full (default: all that is not fixed), loop (poses by their edges alone), local (the "
             "last frame and its neighbours) or incremental (frame by frame)");
  const auto* given_loss = add_choice(
      app, "--robust", loss, kLosses,
      "none, huber or cauchy: loss of observations and of edges that are loops (default: "
      "none; of a map: huber, then none without what is beyond its threshold)");
  const auto* given_frame =
      app.add_option("--keyframe", frame, "of --problem local: around this one, not the last")
          ->option_text("NAME");
  add_choice(app, "--start", options.start, kStarts,
             "of a pose graph: auto (default: the lowest cost of the three), given, tree or "
             "rotations");
  app.add_flag("--fix-intrinsics", options.fix_intrinsics, "cameras are known; else refined");
  app.add_option("--threads", options.threads, "of the solver; above 1 sums depend on them")
      ->capture_default_str()
      ->check(CLI::Range(1, 256).description(""));
  app.add_option("--iterations", options.iterations, "at most")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000).description(""));
  app.add_option("--out", line.out, "folder for the results, made if missing")
      ->capture_default_str();
  const auto* given_format = add_choice(app, "--format", format, formats(),
                                        "of the result (default: the input's): colmap-text or "
                                        "colmap-binary of a COLMAP model, ply of a map, map of "
                                        "all but pose graphs");
  app.add_flag("--quiet", line.quiet, "no progress, warnings and errors only");
  if (const auto end = parse_line(app, argc, argv, [&] {
        if (given_frame->count() > 0 && options.problem != ProblemKind::kLocal) {
          throw CLI::ValidationError("--keyframe: goes with --problem local");
        }
        if (line.out.empty()) throw CLI::ValidationError("--out: \"\" is no name of a folder");
      })) {
    exit_code = *end;
    return std::nullopt;
  }
  if (given_format->count() > 0) line.format = format;
  if (given_loss->count() > 0) options.loss = loss;
  if (given_frame->count() > 0) options.frame = frame;
  return line;
}

}  // namespace hybrid_slam
