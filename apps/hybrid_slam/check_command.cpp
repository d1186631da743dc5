#include "apps/hybrid_slam/check_command.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "apps/dataset_check/check_report.h"
#include "apps/hybrid_slam/input_choice.h"
#include "apps/io/progress_line.h"
#include "apps/io/report.h"
#include "apps/program/program.h"
#include "apps/slam/interrupt.h"
#include "apps/slam/parallel_for.h"
#include "cameras/files/output_file.h"
#include "frontend/input/part_of_sequence.h"

namespace hybrid_slam {
namespace {

constexpr const char* kCheckFooter =
    R"(Reads all images, finds and matches features in some of the pairs, and says what the input is
fit for: pairs, rate and gaps, exposure and blur, how far the rows of left and right agree and where
in the image, distances, what is missing. docs/datasets.md tells what the numbers mean.

Exit codes: 0 nothing speaks against it; 1 internal error; 2 bad usage; 3 it cannot be read;
5 something was found that spoils the SLAM, or may; 130 interrupted.)";

struct CheckLine {
  InputChoice input;
  std::string config;
  std::string json;
  DatasetCheckOptions options;
  bool quiet = false;
};

std::optional<CheckLine> parse(int argc, char** argv, int& exit_code) {
  CheckLine line;
  std::optional<int> features;
  line.options.threads = 0;
  CLI::App app("What a dataset, or own footage, is fit for; without SLAM.", "hybrid_slam check");
  app.footer(kCheckFooter);
  add_input_options(app, line.input);
  app.add_option("--pairs", line.options.pairs,
                 "find features in so many pairs at most, from all over the sequence")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000).description(""));
  app.add_option("--config", line.config, "YAML file with options");
  app.add_option("--features", features, "features per image (default 2000)")
      ->check(CLI::Range(50, 100000).description(""));
  app.add_option("--threads", line.options.threads, "that read and look (default: one per core)")
      ->check(CLI::Range(1, 256).description(""));
  app.add_option("--json", line.json, "file for the same as numbers")->option_text("FILE");
  app.add_flag("--quiet", line.quiet, "no progress");
  if (const auto end = parse_line(app, argc, argv, [&] { check_input_choice(line.input); })) {
    exit_code = *end;
    return std::nullopt;
  }
  if (!line.config.empty()) line.options.slam = read_slam_options(line.config);
  SlamOptions& slam = line.options.slam;
  slam.features = features.value_or(slam.features);
  slam.distribute();
  if (line.options.threads == 0) line.options.threads = default_thread_count();
  return line;
}

}  // namespace

int run_check_command(int argc, char** argv) {
  int exit_code = kExitOk;
  const auto line = parse(argc, argv, exit_code);
  if (!line) return exit_code;
  const Interrupt interrupt;
  const auto sequence = part_of_sequence(open_input(line->input), 0, 1, line->input.limit);
  ProgressLine progress("frames", line->quiet);
  const DatasetCheck check = check_dataset(
      *sequence, line->options,
      [&](std::size_t done, std::size_t total) { progress.update(done, total, ""); },
      interrupt.token());
  progress.finish();
  fmt::print("{}", to_text(check));
  if (!line->json.empty()) write_json(line->json, to_json(check));
  if (check.cancelled) return kExitInterrupted;
  return check.findings.empty() ? kExitOk : kExitFindings;
}

}  // namespace hybrid_slam
