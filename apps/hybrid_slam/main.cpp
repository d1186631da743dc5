#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <filesystem>

#include "apps/hybrid_slam/command_line.h"
#include "apps/hybrid_slam/frame_writer.h"
#include "apps/hybrid_slam/outputs.h"
#include "apps/io/progress_line.h"
#include "apps/program/program.h"
#include "apps/slam/interrupt.h"
#include "apps/slam/log.h"
#include "apps/slam/replay.h"
#include "backend/map/map_file.h"
#include "backend/problem/solver_log.h"
#include "cameras/files/input_error.h"
#include "cameras/files/output_file.h"
#include "frontend/place_recognition/vocabulary_file.h"

namespace hybrid_slam {
namespace {

// Before hours of work, not after: can the results be written? Nothing is left of the trial; of an
// older run the summary goes, so that it is there only if this one has come to its end.
void make_output_folder(const std::string& folder) {
  const auto summary = make_folder(folder) / "summary.json";
  write_file(summary, "{}\n");
  std::filesystem::remove(summary);
}

// What went wrong; the run goes on, and the older checkpoint is still there.
std::string checkpoint(const CommandLine& line, const MapSnapshot& map, const MapFileInfo& info) {
  try {
    write_map(line, map, info);
  } catch (const OutputError& error) {
    return error.what();
  }
  return {};
}

// The map to go on with; an empty one for a new map.
Map starting_map(const CommandLine& line) {
  if (line.map.empty()) return {};
  Map map = load_map(line.map).map;
  const MapSnapshot& view = map.view();
  if (!view.origin().valid()) throw InputError(line.map + ": the map holds no keyframe");
  const DescriptorKind kind = view.at(view.origin()).observations->features.kind;
  if (kind != DescriptorKind::kRootSift) {
    throw InputError(fmt::format("{}: the map's descriptors are {}, those of the images are {}",
                                 line.map, kind_name(kind), kind_name(DescriptorKind::kRootSift)));
  }
  return map;
}

int run(CommandLine line, const Interrupt& interrupt) {
  ReplayOptions options;
  Map map = starting_map(line);
  if (!line.vocabulary.empty()) {
    options.session.vocabulary = load_vocabulary(line.vocabulary, DescriptorKind::kRootSift);
  }
  const auto sequence = open_sequence(line.dataset, line.layout, line.sequence, line.cameras,
                                      line.truth_convention, line.input);
  make_output_folder(line.out);
  if (!line.log.empty()) open_log(line.log, line.log_level);
  for (const std::string& warning : sequence->info().warnings) {
    spdlog::warn(warning);
  }
  if (!line.quiet) {
    const SequenceInfo& info = sequence->info();
    spdlog::info("{} ({}): {} stereo frames of {}x{}{}", info.name, info.layout, sequence->size(),
                 info.stereo.width, info.stereo.height, info.fisheye ? ", with a fisheye" : "");
  }
  ProgressLine progress("frames", line.quiet);
  ReplayHooks hooks;
  hooks.progress = [&](const ReplayProgress& state) {
    progress.update(state.done, state.total,
                    fmt::format("lost {}  keyframes {}  landmarks {}", state.frames.lost,
                                state.keyframes, state.landmarks));
  };
  hooks.warning = [&](const std::string& text) {
    progress.finish();
    spdlog::warn(text);
  };
  FrameWriter writer(line.out, sequence->info().fisheye.has_value(), hooks.warning);
  hooks.frame = [&](const FrameResult& frame) { writer.frame(frame); };
  hooks.left_out = [&](const LeftOut& input) { writer.left_out(input); };
  hooks.cancelled = interrupt.token();
  SessionOptions& session = options.session;
  session.mode = line.mode;
  session.threads = line.threads;
  session.device = line.device;
  session.localize = line.localize;
  session.checkpoint_every = line.checkpoint_every;
  session.checkpoint = [&](const MapSnapshot& so_far, const MapFileInfo& info) {
    return checkpoint(line, so_far, info);
  };
  options.limit = line.limit;
  options.rate = line.rate;

  const auto start = std::chrono::steady_clock::now();
  const RunResult result =
      replay(ImageFrameSource(*sequence), line.options, std::move(options), hooks, std::move(map));
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  progress.finish();
  const RunSummary summary = write_outputs(line, sequence->info(), result, elapsed.count());
  print_summary(line, result, summary);
  if (!result.internal_errors.empty()) {
    spdlog::critical(result.internal_errors.back());
    return kExitInternalError;
  }
  if (result.cancelled) {
    spdlog::warn("interrupted: results up to frame {} are saved", result.frames.read);
    return kExitInterrupted;
  }
  if (result.frames.tracked == 0) {
    spdlog::error(
        line.map.empty()
            ? "no frame could be tracked: too few features or stereo matches to start a map"
            : "no frame could be found in the map of " + line.map);
    return kExitNothingTracked;
  }
  return kExitOk;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  using namespace hybrid_slam;
  return run_program("hybrid_slam", [&]() -> int {
    silence_solver_log();
    int exit_code = kExitOk;
    auto line = parse_command_line(argc, argv, exit_code);
    if (!line) {
      return exit_code;
    }
    const Interrupt interrupt;
    return run(std::move(*line), interrupt);
  });
}
