#include <spdlog/spdlog.h>

#include "apps/io/progress_line.h"
#include "apps/program/program.h"
#include "apps/scene_renderer/command_line.h"

namespace hybrid_slam {
namespace {

int run(const CommandLine& line) {
  const SceneCameras cameras = make_scene_cameras(line.width, line.height);
  const DatasetWriter writer(line.out, line.sequence, line.format, line.options, cameras);
  const SceneSequence sequence(line.options, cameras, line.threads);
  if (!line.quiet) {
    spdlog::info("{}: {} frames of {}x{}, {} triangles", writer.sequence_folder().string(),
                 sequence.motion().size(), line.width, line.height,
                 sequence.seafloor().mesh().triangles.size());
  }
  ProgressLine progress("frames", line.quiet);
  const int frames = static_cast<int>(sequence.motion().size());
  for (int frame = 0; frame < frames; ++frame) {
    if (interrupted()) {
      progress.finish();
      spdlog::warn("interrupted after {} frames", frame);
      return kExitInterrupted;
    }
    writer.write(frame, sequence.render(frame));
    progress.update(static_cast<std::size_t>(frame) + 1, static_cast<std::size_t>(frames), "");
  }
  writer.finish(sequence);
  progress.finish();
  return kExitOk;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  using namespace hybrid_slam;
  return run_program("scene_renderer", [&]() -> int {
    int exit_code = kExitOk;
    const auto line = parse_command_line(argc, argv, exit_code);
    if (!line) return exit_code;
    watch_signals();
    return run(*line);
  });
}
