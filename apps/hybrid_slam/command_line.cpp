#include "apps/hybrid_slam/command_line.h"

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <map>

#include "apps/program/program.h"
#include "apps/slam/log.h"
#include "apps/slam/parallel_for.h"

namespace hybrid_slam {
namespace {

constexpr const char* kFooter = R"(Writes to DIR:
  stereo.tum         every tracked frame, final estimate (world_from_cam of the left camera)
  stereo_online.tum  the estimate at the moment each frame was tracked
  fisheye.tum, fisheye_online.tum   the same of the fisheye
  map.hslam          the whole map, to go on with (docs/map_file.md); not with --localize
  map.ply, map.png   landmarks and keyframes; map and path from above and from the side
  frames.csv         written as it happens: a line per camera frame with its state, pose and
                     covariance, and what was wrong with it
  fisheye_in_left.csv  likewise: pose of the fisheye in the left camera, and covariance
  timing.json        milliseconds per stage: count, mean, p50, p95, p99, max
  timing.csv         CPU time per stereo frame, of the whole process
  loops.csv          places that were proposed as loops, and what came of them
  summary.json       frames, keyframes, landmarks, options, and ATE where the dataset has truth

Exit codes: 0 done; 1 internal error; 2 bad usage, or no such device; 3 bad input (dataset,
configuration or output folder); 4 no frame could be tracked; 130 interrupted, what there was is
saved.)";

// A check of an option's text, with what to say of one that fails.
CLI::Validator must_be(bool (*check)(const std::string&), const std::string& complaint) {
  return {[=](const std::string& text) {
            return check(text) ? std::string() : '"' + text + "\" " + complaint;
          },
          ""};
}

// CLI's own checks let NaN pass, and its conversion wraps negative numbers.
bool is_rate(const std::string& text) {
  double rate = 0;
  return CLI::detail::lexical_cast(text, rate) && rate >= 0.001 && rate <= 1e5;
}

bool is_count(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
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

std::optional<CommandLine> parse_command_line(int argc, char** argv, int& exit_code) {
  CommandLine line;
  std::string config;
  std::string device = "auto";
  std::optional<int> features;
  std::optional<std::uint64_t> seed;
  std::optional<bool> loops;
  const std::map<std::string, SequenceLayout> layouts{{"auto", SequenceLayout::kAuto},
                                                      {"kitti", SequenceLayout::kKitti},
                                                      {"euroc", SequenceLayout::kEuroc},
                                                      {"uwslam", SequenceLayout::kUwslam}};
  const std::map<std::string, SequenceCameras> cameras{{"auto", SequenceCameras::kAuto},
                                                       {"stereo", SequenceCameras::kStereo},
                                                       {"hybrid", SequenceCameras::kHybrid}};
  const std::map<std::string, TruthConvention> conventions{
      {"auto", TruthConvention::kAuto},
      {"world_from_cam", TruthConvention::kWorldFromCam},
      {"cam_from_world", TruthConvention::kCamFromWorld}};
  const std::map<std::string, GrayChannel> channels{{"grey", GrayChannel::kGrey},
                                                    {"red", GrayChannel::kRed},
                                                    {"green", GrayChannel::kGreen},
                                                    {"blue", GrayChannel::kBlue}};
  const std::map<std::string, SessionMode> modes{{"every-frame", SessionMode::kEveryFrame},
                                                 {"realtime", SessionMode::kRealtime}};

  CLI::App app(
      "Visual SLAM on a sequence of stereo images, and those of a fisheye that moves by itself.",
      "hybrid_slam");
  app.footer(kFooter);
  app.add_option("DATASET", line.dataset, "folder of the dataset")->required();
  app.add_option("--layout", line.layout, "auto, kitti, euroc or uwslam")
      ->transform(CLI::CheckedTransformer(layouts).description(""))
      ->option_text("NAME");
  app.add_option("--sequence", line.sequence, "sequence of the dataset; the only one if not given");
  app.add_option("--config", config, "YAML file with options");
  app.add_option("--out", line.out, "folder for the results, made if missing")
      ->capture_default_str()
      ->check(must_be([](const std::string& folder) { return !folder.empty(); },
                      "is no name of a folder"));
  app.add_option(
         "--mode", line.mode,
         "every-frame (default: each frame is mapped before the next, repeatable) or realtime")
      ->transform(CLI::CheckedTransformer(modes).description(""))
      ->option_text("MODE");
  app.add_option("--rate", line.rate,
                 "realtime: images per second; those that come too early are dropped and counted")
      ->check(must_be(is_rate, "is no rate between 0.001 and 100000 Hz"));
  app.add_option("--cameras", line.cameras,
                 "stereo, hybrid (with the fisheye) or auto (default: with the fisheye, if the "
                 "dataset has one)")
      ->transform(CLI::CheckedTransformer(cameras).description(""))
      ->option_text("WHICH");
  app.add_option("--gt-convention", line.truth_convention,
                 "how the true poses of a UWslam sequence are meant; auto (default) finds out")
      ->transform(CLI::CheckedTransformer(conventions).description(""))
      ->option_text("auto|world_from_cam|cam_from_world");
  app.add_option("--channel", line.input.images.channel,
                 "of colour images: grey (default: all three weighed), red, green or blue")
      ->transform(CLI::CheckedTransformer(channels).description(""))
      ->option_text("NAME");
  app.add_option("--white-level", line.input.images.white,
                 "sample that is white in images of more than 8 bits (default: found)")
      ->check(CLI::Range(255, 65535).description(""));
  app.add_option(
         "--pair-tolerance", line.input.pair_tolerance,
         "seconds that the times of left and right may differ (default: a tenth of the frame "
         "period, at most 0.01)")
      ->check(CLI::Range(1e-6, 10.0).description(""));
  app.add_option("--features", features, "features per image (default 2000)")
      ->check(CLI::Range(50, 100000).description(""));
  app.add_option("--seed", seed, "of every random choice (default 0)")
      ->check(must_be(is_count, "is no number from 0"));
  app.add_option("--threads", line.threads, "that extract features (default: one per core)")
      ->check(CLI::Range(1, 256).description(""));
  app.add_option(
         "--device", device,
         "that extracts features: auto (default: cuda where it can be used, else cpu), cpu or "
         "cuda")
      ->check(CLI::IsMember({"auto", "cpu", "cuda"}).description(""))
      ->option_text("NAME");
  app.add_option("--limit", line.limit, "process so many frames at most")
      ->check(CLI::PositiveNumber.description(""));
  app.add_option("--checkpoint-every", line.checkpoint_every,
                 "write map.hslam on the way, every so many keyframes")
      ->check(CLI::Range(1, 1000000).description(""));
  app.add_option("--vocabulary", line.vocabulary,
                 "file of a vocabulary of RootSIFT, to recognise places with (default: built in)");
  app.add_option("--loops", loops,
                 "on (default) or off: recognise places seen before and correct the map")
      ->transform(CLI::CheckedTransformer(std::map<std::string, bool>{{"on", true}, {"off", false}})
                      .description(""))
      ->option_text("on|off");
  app.add_option("--map", line.map, "map file (map.hslam) to go on with")->option_text("FILE");
  app.add_flag("--localize", line.localize, "track in the map of --map without changing it");
  app.add_option("--log", line.log, "file for what happens on the way and why; gone on with")
      ->option_text("FILE");
  auto* const log_level = app.add_option("--log-level", line.log_level,
                                         "trace, debug, info (default), warning or error")
                              ->check(must_be(is_log_level, "is no level"))
                              ->option_text("LEVEL");
  app.add_flag("--quiet", line.quiet, "no progress, warnings and errors only");
  if (const auto end = parse_line(app, argc, argv, [&] {
        if (line.rate > 0 && line.mode != SessionMode::kRealtime) {
          throw CLI::ValidationError("--rate needs --mode realtime");
        }
        if (log_level->count() > 0 && line.log.empty()) {
          throw CLI::ValidationError("--log-level needs --log");
        }
        if (line.localize && line.map.empty()) {
          throw CLI::ValidationError("--localize needs --map");
        }
        if (line.localize && line.checkpoint_every > 0) {
          throw CLI::ValidationError(
              "--localize changes no map: nothing for --checkpoint-every to save");
        }
      })) {
    exit_code = *end;
    return std::nullopt;
  }
  if (!config.empty()) {
    line.options = read_slam_options(config);
  }
  line.options.features = features.value_or(line.options.features);
  line.options.seed = seed.value_or(line.options.seed);
  line.options.loops.enabled = loops.value_or(line.options.loops.enabled);
  line.options.distribute();
  const auto chosen_device = choose_device(device, line.options.sift);
  if (!chosen_device) {
    exit_code = kExitBadUsage;
    return std::nullopt;
  }
  line.device = *chosen_device;
  if (line.threads == 0) {
    line.threads = default_thread_count();
  }
  return line;
}

}  // namespace hybrid_slam
