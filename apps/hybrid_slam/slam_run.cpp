#include "apps/hybrid_slam/slam_run.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <filesystem>
#include <utility>

#include "apps/hybrid_slam/frame_writer.h"
#include "apps/hybrid_slam/outputs.h"
#include "apps/io/progress_line.h"
#include "apps/program/program.h"
#include "apps/slam/log.h"
#include "backend/map/map_file.h"
#include "cameras/files/input_error.h"
#include "cameras/files/output_file.h"
#include "frontend/place_recognition/vocabulary_file.h"

namespace hybrid_slam {
namespace {

// Nothing is left of the trial; of an
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

void say_what_comes(const CommandLine& line, const RunInput& input) {
  for (const std::string& warning : input.info().warnings) {
    spdlog::warn(warning);
  }
  if (!line.quiet) spdlog::info(input.opening());
}

// Whoever watches is told what the run tells.
void let_watch(LiveView& view, const RunInput& input, Map& map, ReplayHooks& hooks) {
  const SequenceInfo& info = input.info();
  view.begin({info.name, {info.stereo, info.fisheye}});
  LiveFeed& feed = view.feed();
  if (map.view().origin().valid()) feed.map(map.snapshot(), MapChange::kKeyframe);
  hooks.frame = [tell = hooks.frame, &feed](const FrameResult& frame) {
    tell(frame);
    feed.frame(frame);
  };
  hooks.left_out = [tell = hooks.left_out, &feed](const LeftOut& left_out) {
    tell(left_out);
    feed.left_out(left_out);
  };
  hooks.keyframe = [&feed](const KeyframeResult& keyframe) { feed.keyframe(keyframe); };
  hooks.loop = [&feed](const LoopRecord& loop) { feed.loop(loop); };
  hooks.map = [&feed](const std::shared_ptr<const MapSnapshot>& changed, MapChange change) {
    feed.map(changed, change);
  };
  hooks.images = [&feed](const Moment& moment) { feed.images(moment); };
}

int exit_code(const CommandLine& line, const RunResult& result) {
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

PreparedRun prepare_run(const CommandLine& line) {
  PreparedRun run{starting_map(line), {}, {}};
  if (line.view) run.view = std::make_unique<LiveView>(*line.view);
  SessionOptions& session = run.session;
  if (!line.vocabulary.empty()) {
    session.vocabulary = load_vocabulary(line.vocabulary, DescriptorKind::kRootSift);
  }
  session.mode = line.mode;
  session.threads = line.threads;
  session.device = line.device;
  session.localize = line.localize;
  session.history = 0;  // nobody asks for poses
  session.checkpoint_every = line.checkpoint_every;
  session.checkpoint = [&line](const MapSnapshot& so_far, const MapFileInfo& info) {
    return checkpoint(line, so_far, info);
  };
  return run;
}

void begin_outputs(const CommandLine& line) {
  make_output_folder(line.out);
  if (!line.log.empty()) open_log(line.log, line.log_level);
}

int run_slam(const CommandLine& line, PreparedRun prepared, RunInput& input,
             const std::stop_token& cancelled) {
  say_what_comes(line, input);
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
  FrameWriter writer(line.out, input.info().fisheye.has_value(), hooks.warning);
  hooks.frame = [&](const FrameResult& frame) { writer.frame(frame); };
  hooks.left_out = [&](const LeftOut& left_out) { writer.left_out(left_out); };
  hooks.times = [&](const FrameTimes& times) { writer.times(times); };
  hooks.cancelled = cancelled;
  if (prepared.view) {
    let_watch(*prepared.view, input, prepared.map, hooks);
    if (!line.quiet) spdlog::info("watch it at {}", prepared.view->url());
  }
  const auto start = std::chrono::steady_clock::now();
  const RunResult result =
      input.run(line.options, std::move(prepared.session), hooks, std::move(prepared.map));
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  progress.finish();
  const RunSummary summary = write_outputs(line, input, result, elapsed.count());
  print_summary(line, result, summary);
  if (prepared.view) prepared.view->end("results are in " + line.out);
  return exit_code(line, result);
}

}  // namespace hybrid_slam
