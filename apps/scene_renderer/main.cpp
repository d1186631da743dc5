#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <csignal>

#include "apps/io/progress_line.h"
#include "apps/scene_renderer/command_line.h"
#include "cameras/input_error.h"
#include "cameras/output_file.h"

namespace hybrid_slam {
namespace {

std::atomic<bool> interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free, "set by a signal handler");

// The first Ctrl-C ends the run in order; a second one kills the program as usual.
void on_signal(int signal) {
  interrupted = true;
  std::signal(signal, SIG_DFL);
}

int run(const CommandLine& line) {
  const SceneCameras cameras = make_scene_cameras(line.width, line.height);
  const DatasetWriter writer(line.out, line.sequence, line.format, line.options, cameras);
  const SceneSequence sequence(line.options, cameras, line.threads);
  if (!line.quiet) {
    spdlog::info("{}: {} frames of {}x{}, {} triangles", writer.sequence_folder().string(),
                 line.options.frames, line.width, line.height,
                 sequence.seafloor().mesh().triangles.size());
  }
  ProgressLine progress("frames", line.quiet);
  for (int frame = 0; frame < line.options.frames; ++frame) {
    if (interrupted) {
      progress.finish();
      spdlog::warn("interrupted after {} frames", frame);
      return kExitInterrupted;
    }
    writer.write(frame, sequence.render(frame));
    progress.update(static_cast<std::size_t>(frame) + 1,
                    static_cast<std::size_t>(line.options.frames), "");
  }
  writer.finish(sequence);
  progress.finish();
  return kExitOk;
}

int guarded_main(int argc, char** argv) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("scene_renderer"));
  spdlog::set_pattern("%n: %^%l%$: %v");
  try {
    int exit_code = kExitOk;
    const auto line = parse_command_line(argc, argv, exit_code);
    if (!line) return exit_code;
    std::signal(SIGINT, on_signal);
    std::signal(SIGTERM, on_signal);
    return run(*line);
  } catch (const InputError& error) {
    spdlog::error(error.what());
    return kExitBadInput;
  } catch (const OutputError& error) {
    spdlog::error(error.what());
    return kExitBadInput;
  } catch (const std::exception& error) {
    spdlog::critical("internal error: {}", error.what());
    return kExitInternalError;
  }
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) { return hybrid_slam::guarded_main(argc, argv); }
