#include "apps/hybrid_slam/run_options.h"

#include <spdlog/spdlog.h>

#include <map>

#include "apps/program/program.h"
#include "apps/slam/log.h"
#include "apps/slam/parallel_for.h"

namespace hybrid_slam {

const char* const kWrittenFiles =
    R"(Writes to DIR:
  stereo.tum         every tracked frame, final estimate (world_from_cam of the left camera)
  stereo_online.tum  the estimate at the moment each frame was tracked
  fisheye.tum, fisheye_online.tum   the same of the fisheye
  map.hslam          the whole map, to go on with (docs/map_file.md); not with --localize
  map.ply, map.png   landmarks and keyframes; map and path from above and from the side
  frames.csv         written as it happens: a line per camera frame with its state, pose and
                     covariance, and what was wrong with it
  fisheye_in_left.csv  likewise: pose of the fisheye in the left camera, and covariance
  timing.json        milliseconds per stage: count, mean, p50, p95, p99, max
  timing.csv         CPU time per stereo frame, of the whole process; how far behind it was tracked
  loops.csv          places that were proposed as loops, and what came of them
  summary.json       frames, keyframes, landmarks, options, and ATE where the dataset has truth
  errors.csv         per frame, its distance from the truth, where the dataset has it
  keyframes.csv, residuals.csv, coverage.csv   how good the map is, by keyframe, image and ground
  calibration.csv    how good the calibration is, by place in the images (docs/calibration.md)
  report.html        all of this to look at, in one file for a browser (docs/report.md))";

namespace {

bool is_count(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

bool is_port(const std::string& text) {
  return is_count(text) && text.size() <= 5 && std::stoi(text) <= 65535;
}

// The device that was asked for; none if it cannot be used, which has been reported.
std::optional<SiftDevice> choose_device(const std::string& name, const SiftOptions& options) {
  if (name == "cpu") return SiftDevice::kCpu;
  const std::string why_not = why_no_cuda_sift(options);
  if (why_not.empty()) return SiftDevice::kCuda;
  if (name == "auto") return SiftDevice::kCpu;
  spdlog::error("--device cuda: {}", why_not);
  return std::nullopt;
}

}  // namespace

CLI::Validator must_be(bool (*check)(const std::string&), const std::string& complaint) {
  return {[=](const std::string& text) {
            return check(text) ? std::string() : '"' + text + "\" " + complaint;
          },
          ""};
}

bool is_rate(const std::string& text) {
  double rate = 0;
  return CLI::detail::lexical_cast(text, rate) && rate >= 0.001 && rate <= 1e5;
}

RunOptions::RunOptions(CLI::App& app, CommandLine& line) : app_(app), line_(line) {
  const std::map<std::string, SessionMode> modes{{"every-frame", SessionMode::kEveryFrame},
                                                 {"realtime", SessionMode::kRealtime}};
  const bool realtime = line.mode == SessionMode::kRealtime;
  app.add_option("--config", config_, "YAML file with options");
  app.add_option("--out", line_.out, "folder for the results, made if missing")
      ->capture_default_str()
      ->check(must_be([](const std::string& folder) { return !folder.empty(); },
                      "is no name of a folder"));
  app.add_option(
         "--mode", line_.mode,
         realtime
             ? "realtime (default: tracking, mapping and loops at the same time) or every-frame "
               "(each frame is mapped before the next)"
             : "every-frame (default: each frame is mapped before the next, repeatable) or "
               "realtime")
      ->transform(CLI::CheckedTransformer(modes).description(""))
      ->option_text("MODE");
  app.add_option("--features", features_, "features per image (default 2000)")
      ->check(CLI::Range(50, 100000).description(""));
  app.add_option("--seed", seed_, "of every random choice (default 0)")
      ->check(must_be(is_count, "is no number from 0"));
  app.add_option("--threads", line_.threads, "that extract features (default: one per core)")
      ->check(CLI::Range(1, 256).description(""));
  app.add_option(
         "--device", device_,
         "that extracts features: auto (default: cuda where it can be used, else cpu), cpu or "
         "cuda")
      ->check(CLI::IsMember({"auto", "cpu", "cuda"}).description(""))
      ->option_text("NAME");
  app.add_option("--checkpoint-every", line_.checkpoint_every,
                 "write map.hslam on the way, every so many keyframes")
      ->check(CLI::Range(1, 1000000).description(""));
  app.add_option("--vocabulary", line_.vocabulary,
                 "file of a vocabulary of RootSIFT, to recognise places with (default: built in)");
  app.add_option("--loops", loops_,
                 "on (default) or off: recognise places seen before and correct the map")
      ->transform(CLI::CheckedTransformer(std::map<std::string, bool>{{"on", true}, {"off", false}})
                      .description(""))
      ->option_text("on|off");
  app.add_option("--report", line_.report, "on (default) or off: write report.html")
      ->transform(CLI::CheckedTransformer(std::map<std::string, bool>{{"on", true}, {"off", false}})
                      .description(""))
      ->option_text("on|off");
  add_view(app);
  app.add_option("--map", line_.map, "map file (map.hslam) to go on with")->option_text("FILE");
  app.add_flag("--localize", line_.localize, "track in the map of --map without changing it");
  app.add_option("--log", line_.log, "file for what happens on the way and why; gone on with")
      ->option_text("FILE");
  log_level_ = app.add_option("--log-level", line_.log_level,
                              "trace, debug, info (default), warning or error")
                   ->check(must_be(is_log_level, "is no level"))
                   ->option_text("LEVEL");
  app.add_flag("--quiet", line_.quiet, "no progress, warnings and errors only");
}

void RunOptions::add_view(CLI::App& app) {
  const auto options = [this]() -> ServerOptions& {
    if (!line_.view) line_.view.emplace();
    return *line_.view;
  };
  view_ = app.add_option_function<std::vector<std::string>>(
                 "--view",
                 [options](const std::vector<std::string>& port) {
                   ServerOptions& view = options();
                   if (!port.empty() && !port[0].empty()) view.port = std::stoi(port[0]);
                 },
                 "the run can be watched in a browser, at this port (default: 8417; 0: any that "
                 "is free)")
              ->expected(0, 1)
              ->check(must_be(is_port, "is no port: --view PORT, 0 to 65535, or --view at the end"))
              ->option_text("[PORT]");
  view_address_ = app.add_option_function<std::string>(
                         "--view-address",
                         [options](const std::string& address) { options().address = address; },
                         "address of this machine at which it can be watched (default: 127.0.0.1, "
                         "by this machine alone)")
                      ->option_text("ADDRESS");
}

std::optional<int> RunOptions::read(int argc, char** argv, const std::function<void()>& check) {
  const auto end = parse_line(app_, argc, argv, [&] {
    check();
    this->check();
  });
  if (end) return end;
  if (!settle()) return kExitBadUsage;
  return std::nullopt;
}

// Throws CLI::ValidationError where they do not go together.
void RunOptions::check() const {
  if (view_address_->count() > 0 && view_->count() == 0) {
    throw CLI::ValidationError("--view-address needs --view");
  }
  if (log_level_->count() > 0 && line_.log.empty()) {
    throw CLI::ValidationError("--log-level needs --log");
  }
  if (line_.localize && line_.map.empty()) {
    throw CLI::ValidationError("--localize needs --map");
  }
  if (line_.localize && line_.checkpoint_every > 0) {
    throw CLI::ValidationError("--localize changes no map: nothing for --checkpoint-every to save");
  }
}

// Once they are parsed. False if the device that was asked for is not there, which has been
// reported.
bool RunOptions::settle() {
  SlamOptions& slam = line_.options;
  if (!config_.empty()) slam = read_slam_options(config_);
  slam.features = features_.value_or(slam.features);
  slam.seed = seed_.value_or(slam.seed);
  slam.loops.enabled = loops_.value_or(slam.loops.enabled);
  slam.distribute();
  const auto chosen_device = choose_device(device_, slam.sift);
  if (!chosen_device) return false;
  line_.device = *chosen_device;
  if (line_.threads == 0) line_.threads = default_thread_count();
  return true;
}

}  // namespace hybrid_slam
