#include "apps/hybrid_slam/live_command.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <utility>

#include "apps/hybrid_slam/live_line.h"
#include "apps/hybrid_slam/provenance.h"
#include "apps/hybrid_slam/slam_run.h"
#include "apps/program/program.h"
#include "apps/slam/interrupt.h"
#include "apps/slam/live/capture_protocol.h"
#include "apps/slam/live/live_run.h"
#include "apps/slam/live/stream_source.h"
#include "apps/slam/live/watched_source.h"
#include "apps/slam/log.h"
#include "cameras/files/input_error.h"
#include "cameras/files/output_file.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::unique_ptr<SetSource> open_streams(const LiveLine& line) {
  std::vector<StreamSpec> specs;
  const auto add = [&](LiveCamera camera, const std::string& name) {
    if (name.empty()) return;
    const StreamKind kind = kind_of_stream(name);
    specs.push_back(
        {camera, name,
         [name, timeout = line.timeout, channel = line.run.input.options.images.channel] {
           return open_stream(name, timeout, channel);
         },
         kind == StreamKind::kFile, kind == StreamKind::kUrl || kind == StreamKind::kPipeline,
         line.rate});
  };
  add(LiveCamera::kLeft, line.left);
  add(LiveCamera::kRight, line.right);
  add(LiveCamera::kFisheye, line.fisheye);
  StreamOptions options;
  options.split = line.split;
  options.realtime = line.run.mode == SessionMode::kRealtime;
  options.timeout = line.timeout;
  options.tolerance = line.run.input.options.pair_tolerance;
  return std::make_unique<StreamSource>(std::move(specs), options);
}

// What the names stand for in the watched folder.
LiveLine in_watched_folder(LiveLine line) {
  const fs::path folder = line.watch;
  if (!fs::is_directory(folder)) throw InputError(line.watch + ": no such folder");
  const bool fisheye = !line.fisheye.empty() || fs::is_directory(folder / "fisheye");
  line.left = (folder / (line.left.empty() ? "left" : line.left)).string();
  line.right = (folder / (line.right.empty() ? "right" : line.right)).string();
  if (fisheye) line.fisheye = (folder / (line.fisheye.empty() ? "fisheye" : line.fisheye)).string();
  return line;
}

std::unique_ptr<SetSource> open_folder(const LiveLine& line) {
  WatchOptions options;
  options.left = line.left;
  options.right = line.right;
  options.fisheye = line.fisheye;
  options.timeout = line.timeout;
  options.rate = line.rate;
  options.tolerance = line.run.input.options.pair_tolerance;
  options.reading = line.run.input.options.images;
  return std::make_unique<WatchedSource>(std::move(options));
}

// Those of the run that a recording is of.
fs::path options_of(const fs::path& recording) { return recording / "options.yaml"; }

Json by_camera(const PerCamera<std::int64_t>& counts) {
  Json json;
  for (const LiveCamera camera : kAllLiveCameras) json[to_string(camera)] = of(counts, camera);
  return json;
}

class LiveInput final : public RunInput {
 public:
  LiveInput(const LiveLine& line, std::unique_ptr<SetSource> source, LiveCameras cameras,
            std::optional<SetRecorder> recorder, const std::stop_token& stop)
      : line_(line),
        source_(std::move(source)),
        cameras_(std::move(cameras)),
        stop_(stop),
        recorder_(std::move(recorder)) {}

  const SequenceInfo& info() const override { return cameras_.info; }

  std::string opening() const override {
    return fmt::format(
        "{} (live): {} stereo images of {}x{}{}; Ctrl-C ends the run", cameras_.info.name,
        cameras_.images == FootageImages::kRaw ? "raw" : "rectified", cameras_.sizes.left.width,
        cameras_.sizes.left.height, cameras_.info.fisheye ? ", with a fisheye" : "");
  }

  RunResult run(const SlamOptions& options, SessionOptions session, const ReplayHooks& hooks,
                Map map) override {
    LiveOptions live;
    live.session = std::move(session);
    live.limit = line_.run.input.limit;
    live.stop = stop_;
    RunResult result = run_live(
        *source_, cameras_, options, std::move(live), hooks, recorder_ ? &*recorder_ : nullptr,
        [&](const Moment& moment) {
          checksums_.push_back(checksum_of(moment));
          if (hooks.images) hooks.images(moment);
        },
        std::move(map));
    counts_ = source_->counts();
    source_.reset();
    return result;
  }

  std::string checksum() const override { return checksum_of(checksums_); }

  std::string dataset() const override {
    if (recorder_) return fs::absolute(line_.record).lexically_normal().string();
    return line_.watch.empty() ? line_.left : fs::absolute(line_.watch).lexically_normal().string();
  }

  const ImageSequence* pictures() override {
    if (!recorder_ || recorder_->recorded() == 0) return nullptr;
    Footage footage;
    footage.left = {(fs::path(line_.record) / "left").string()};
    footage.right = {(fs::path(line_.record) / "right").string()};
    if (cameras_.info.fisheye) footage.fisheye = {(fs::path(line_.record) / "fisheye").string()};
    footage.calibration = recorder_->calibration();
    try {
      pictures_ = open_footage(footage, cameras_.images, line_.run.input.options);
    } catch (const InputError&) {  // a recording that was cut short, of one image, say
      return nullptr;
    }
    return pictures_.get();
  }

  Json live() const override {
    Json json;
    json["sets"] = checksums_.size();
    json["images"] = by_camera(counts_.images);
    json["alone"] = by_camera(counts_.alone);
    json["held_up"] = by_camera(counts_.held_up);
    json["dropped"] = by_camera(counts_.dropped);
    for (const LiveCamera camera : kAllLiveCameras) {
      json["lost"][to_string(camera)] = of(counts_.lost, camera);
    }
    json["recorded"] = recorder_ ? Json(recorder_->recorded()) : Json();
    json["recording_complete"] = recorder_ ? Json(!recorder_->failed()) : Json();
    return json;
  }

  bool recording_failed() const { return recorder_ && recorder_->failed(); }

  // How the recording is replayed; empty: there is none.
  std::string replay_command() const {
    if (!recorder_) return {};
    const fs::path folder = line_.record;
    std::string command = "hybrid_slam";
    const auto add = [&](const std::string& option, const fs::path& path) {
      command += " " + option + " " + shell_word(path.string());
    };
    add("--left", folder / "left");
    add("--right", folder / "right");
    if (cameras_.info.fisheye) add("--fisheye", folder / "fisheye");
    command += " --calibration";
    for (const std::string& file : recorder_->calibration()) command += " " + shell_word(file);
    add("--config", options_of(folder));
    if (!line_.run.map.empty()) add("--map", line_.run.map);
    if (!line_.run.vocabulary.empty()) add("--vocabulary", line_.run.vocabulary);
    if (line_.run.localize) command += " --localize";
    return command +
           (cameras_.images == FootageImages::kRaw ? " --images raw" : " --images rectified");
  }

 private:
  const LiveLine& line_;
  std::unique_ptr<SetSource> source_;
  LiveCameras cameras_;
  std::stop_token stop_;
  std::optional<SetRecorder> recorder_;
  std::vector<std::uint64_t> checksums_;
  LiveCounts counts_;
  std::unique_ptr<ImageSequence> pictures_;
};

// What of the command line cannot be used is said before the cameras are waited for.
int run(const LiveLine& line, const Interrupt& interrupt) {
  PreparedRun prepared = prepare_run(line.run);
  begin_outputs(line.run);
  for (const std::string& file : line.run.input.footage.calibration) read_text_file(file);
  std::optional<SetRecorder> recorder;
  if (!line.record.empty()) {
    recorder.emplace(line.record, line.run.input.footage.calibration, !line.fisheye.empty());
    write_file(options_of(line.record), write_slam_options(line.run.options));
  }
  auto source = line.watch.empty() ? open_streams(line) : open_folder(line);
  source->set_tell([&](const std::string& text) {
    log_of(LogRoom::kInput).info(text);
    spdlog::warn(text);
  });
  Footage footage = line.run.input.footage;
  footage.left = {line.watch.empty() ? line.left : line.watch};
  if (!line.fisheye.empty()) footage.fisheye = {line.fisheye};
  auto cameras = settle_cameras(*source, footage, line.run.input.images, interrupt.token());
  if (!cameras) {
    if (!interrupt.token().stop_requested()) throw InputError(line.left + ": ended without a pair");
    spdlog::warn("interrupted before the first images came");
    return kExitInterrupted;
  }
  LiveInput input(line, std::move(source), std::move(*cameras), std::move(recorder),
                  interrupt.token());
  const int exit_code = run_slam(line.run, std::move(prepared), input, {});
  const std::string replay = input.replay_command();
  if (!replay.empty()) fmt::print("recorded   replay it by: {}\n", replay);
  return exit_code == kExitOk && input.recording_failed() ? kExitRecordingIncomplete : exit_code;
}

}  // namespace

int run_live_command(int argc, char** argv) {
  int exit_code = kExitOk;
  const auto line = parse_live_line(argc, argv, exit_code);
  if (!line) return exit_code;
  const Interrupt interrupt;
  return run(line->watch.empty() ? *line : in_watched_folder(*line), interrupt);
}

}  // namespace hybrid_slam
