#include "apps/hybrid_slam/live_line.h"

#include <CLI/CLI.hpp>

#include "apps/hybrid_slam/run_options.h"

namespace hybrid_slam {
namespace {

constexpr const char* kLiveIntroduction =
    R"(A stream is what OpenCV opens: the number of a camera or /dev/video0; rtsp://, udp:// or http://;
a pipeline of GStreamer that ends in "! appsink"; a video. docs/live.md tells the rest.

Ctrl-C, or SIGTERM, is the end of a run: what came before is tracked, the map adjusted, everything
written. A second one ends it at once.)";

constexpr const char* kLiveExitCodes =
    R"(Exit codes: 0 done, by Ctrl-C, --limit or the videos' end; 1 internal error; 2 bad usage, no such
device, or a port in use; 3 bad input: no such camera, none that delivers, images that cannot be brought
together, calibration, configuration or folders; 4 no frame could be tracked; 6 all is well but the
recording, which had to end before the run; 130 interrupted before the first images came.)";

void add_stream_options(CLI::App& app, LiveLine& line) {
  app.add_option("--left", line.left, "stream of the left camera")->option_text("STREAM");
  app.add_option("--right", line.right, "likewise, of the right one")->option_text("STREAM");
  app.add_option("--fisheye", line.fisheye, "likewise, of the fisheye")->option_text("STREAM");
  app.add_flag("--split", line.split,
               "images of --left hold the left and the right one side by side");
  app.add_option("--watch", line.watch,
                 "instead of streams: a folder that a recorder is writing to, with left, right and "
                 "fisheye in it, or what --left, --right and --fisheye name in it (folders, quoted "
                 "patterns)")
      ->option_text("DIR");
  app.add_option("--calibration", line.run.input.footage.calibration,
                 "of the pair (one file, or left and right), then of the fisheye")
      ->option_text("FILE...");
  app.add_option("--record", line.record,
                 "folder for the images that are taken, to be replayed to the same results")
      ->option_text("DIR");
  app.add_option("--timeout", line.timeout,
                 "seconds in which each camera must deliver (default 10)")
      ->check(CLI::Range(0.1, 3600.0).description(""));
  app.add_option("--rate-hint", line.rate,
                 "images per second: of streams that say nothing, or something wrong; of watched "
                 "folders whose names are numbers")
      ->check(must_be(is_rate, "is no rate between 0.001 and 100000 Hz"))
      ->option_text("HZ");
  app.add_option("--limit", line.run.input.limit, "take so many sets of images at most")
      ->check(CLI::PositiveNumber.description(""));
}

void check(const LiveLine& line) {
  if (line.run.input.footage.calibration.empty()) {
    throw CLI::ValidationError("--calibration is required");
  }
  if (!line.watch.empty()) {
    if (line.split) throw CLI::ValidationError("--split and --watch: one or the other");
    return;
  }
  if (line.left.empty()) throw CLI::ValidationError("--left is required, or --watch");
  if (line.split && !line.right.empty()) {
    throw CLI::ValidationError("--split and --right: one or the other");
  }
  if (!line.split && line.right.empty()) {
    throw CLI::ValidationError("--left needs --right, or --split");
  }
}

}  // namespace

std::optional<LiveLine> parse_live_line(int argc, char** argv, int& exit_code) {
  LiveLine line;
  line.run.mode = SessionMode::kRealtime;
  CLI::App app("Visual SLAM on what cameras see now.", "hybrid_slam live");
  app.footer(std::string(kLiveIntroduction) + "\n\n" + kWrittenFiles + "\n\n" + kLiveExitCodes);
  add_stream_options(app, line);
  add_image_options(app, line.run.input);
  RunOptions options(app, line.run);
  if (const auto end = options.read(argc, argv, [&] { check(line); })) {
    exit_code = *end;
    return std::nullopt;
  }
  return line;
}

}  // namespace hybrid_slam
