#include "apps/scene_renderer/command_line.h"

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <charconv>

#include "apps/program/program.h"
#include "apps/scene_renderer/condition_arguments.h"
#include "apps/slam/parallel_for.h"

namespace hybrid_slam {
namespace {

constexpr const char* kFooter = R"(Writes, in the layout of UWslam:
  hybrid   OUT/hybrid/NAME: images/raw/<n>_{left,right,fish}, camera_poses.txt (world_from_cam)
           OUT/hybrid/calibration: shared by the sequences beside each other
  survey   OUT/NAME: images/<n>_{0,1}, gt_poses.txt, calibration/
  both     times.txt; gt_left_tum.txt (gt_fish_tum.txt): exact poses, world_from_cam; scene.json,
           written last: the options; frames in which the fisheye is blind or turned away
           --arm, --dirt: masks/: 0 where the arm is seen; what the port lets through
           --miscalibrate: true_cameras.json, the cameras that made the images

Presets: easy (clear water), normal (haze, marine snow), hard (thick haze, much snow, fish, a vehicle
that sways; hybrid: silt clouds that blind the fisheye, a wrist that turns away and back). Each of
these has one hardship in clear water: sand (--ground sand), low-light (--photons 400 --read-noise 3
--exposure-bias -1.5), blur (--exposure-time 0.1 --shake 1.5), silt and lamps-off (for 3 s after 2/5
of the time), arm (--arm 30).
The same options give the same bytes on one machine, with any number of threads.

Exit codes: 0 done; 1 internal error; 2 bad usage; 3 the output folder cannot be used; 130
interrupted: images so far are there, truth and scene.json are not.)";

constexpr int kSmallest = 64, kLargest = 8192;  // [px] sides of an image

template <typename T>
CLI::Option* add_choice(CLI::App& app, const std::string& name, T& value,
                        const std::map<std::string, T>& choices, const std::string& text) {
  return app.add_option(name, value, text)
      ->transform(CLI::CheckedTransformer(choices).description(""))
      ->option_text("NAME");
}

// "WIDTHxHEIGHT" of the stereo images.
void parse_resolution(const std::string& text, CommandLine& line) {
  const char* const end = text.data() + text.size();
  const auto width = std::from_chars(text.data(), end, line.width);
  const bool has_x = width.ec == std::errc() && width.ptr != end && *width.ptr == 'x';
  const auto height = std::from_chars(has_x ? width.ptr + 1 : end, end, line.height);
  const auto fits = [](int size) { return size >= kSmallest && size <= kLargest; };
  if (!has_x || height.ec != std::errc() || height.ptr != end || !fits(line.width) ||
      !fits(line.height)) {
    throw CLI::ValidationError("--resolution: \"" + text + "\" is no size like 1024x768");
  }
}

// The name of one folder.
void check_sequence_name(const std::string& name) {
  if (name.empty() || name == "." || name == ".." || name == "calibration" ||
      name.find('/') != std::string::npos) {
    throw CLI::ValidationError("--sequence: \"" + name + "\" is no name of a sequence");
  }
}

}  // namespace

std::optional<CommandLine> parse_command_line(int argc, char** argv, int& exit_code) {
  CommandLine line;
  SceneKind kind = SceneKind::kHybrid;
  Difficulty difficulty = Difficulty::kNormal;
  std::uint32_t seed = 0;
  std::uint32_t visit = 0;
  std::optional<int> frames;
  std::optional<double> width;
  std::string resolution;
  const std::map<std::string, ImageFormat> formats{{"jpg", ImageFormat::kJpeg},
                                                   {"png", ImageFormat::kPng}};

  CLI::App app("Renders a dataset of the seafloor with exact truth.", "scene_renderer");
  app.footer(kFooter);
  app.add_option("OUT", line.out, "folder of the dataset, made if missing")->required();
  add_choice(app, "--kind", kind, scene_kinds(),
             "hybrid (default: a hovering vehicle's stereo pair and a fisheye on its arm, 3 Hz) or "
             "survey (the stereo pair in a spiral with arms across, 5 Hz)");
  app.add_option("--sequence", line.sequence, "its name (default: the preset's, or stereo)");
  add_choice(app, "--preset", difficulty, difficulties(),
             "easy, normal (default), hard, sand, low-light, blur, silt, lamps-off or arm");
  app.add_option("--seed", seed, "of everything random: another seafloor, another motion")
      ->capture_default_str();
  app.add_option(
         "--visit", visit,
         "of the same seafloor: other lamps, snow, noise, another motion (surveys: with the "
         "same --width)")
      ->capture_default_str();
  app.add_option("--frames", frames, "(default: 120, survey 400)")
      ->check(CLI::Range(1, 100000).description(""));
  app.add_option("--width", width,
                 "of a survey's spiral [m] (default: what the frames cover at 0.28 m/s)")
      ->option_text("M");
  app.add_option("--resolution", resolution,
                 "of the stereo images (default 1024x768); the fisheye's are squares as wide")
      ->option_text("WxH");
  add_choice(app, "--format", line.format, formats, "of the images: jpg (default) or png");
  app.add_option("--threads", line.threads, "that render (default: one per core)")
      ->check(CLI::Range(1, 256).description(""));
  app.add_flag("--quiet", line.quiet, "no progress, errors only");
  ConditionArguments conditions(app);
  if (const auto end = parse_line(app, argc, argv, [&] {
        if (line.out.empty()) throw CLI::ValidationError("OUT: \"\" is no name of a folder");
        if (width && kind != SceneKind::kSurvey) {
          throw CLI::ValidationError("--width needs --kind survey");
        }
        if (width && !(*width >= 1 && *width <= 50)) {  // not NaN, which CLI lets pass
          throw CLI::ValidationError("--width: is no width between 1 and 50 m");
        }
        if (!resolution.empty()) parse_resolution(resolution, line);
        if (line.sequence.empty()) {
          line.sequence = kind == SceneKind::kSurvey ? "stereo" : "hybrid";
        }
        check_sequence_name(line.sequence);
        conditions.check();
      })) {
    exit_code = *end;
    return std::nullopt;
  }
  line.options = make_scene_options(kind, difficulty, seed, frames);
  line.options.visit = visit;
  line.options.width = width.value_or(line.options.width);
  conditions.apply(line.options.conditions);
  if (line.threads == 0) line.threads = default_thread_count();
  return line;
}

}  // namespace hybrid_slam
