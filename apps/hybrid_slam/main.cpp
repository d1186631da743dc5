#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cstdlib>
#include <filesystem>
#include <string_view>

#include "apps/hybrid_slam/check_command.h"
#include "apps/hybrid_slam/command_line.h"
#include "apps/hybrid_slam/live_command.h"
#include "apps/hybrid_slam/provenance.h"
#include "apps/hybrid_slam/slam_run.h"
#include "apps/program/program.h"
#include "apps/slam/interrupt.h"
#include "apps/view/http_server.h"
#include "backend/problem/solver_log.h"

namespace hybrid_slam {
namespace {

std::string absolute_path(const std::string& path) {
  std::error_code error;  // then as it was given
  const std::filesystem::path absolute = std::filesystem::absolute(path, error);
  return error ? path : absolute.lexically_normal().string();
}

// Images of files, from the first to the last.
class ReplayInput final : public RunInput {
 public:
  ReplayInput(const CommandLine& line, const ImageSequence& sequence)
      : line_(line), sequence_(sequence), images_(sequence), source_(images_) {}

  const SequenceInfo& info() const override { return sequence_.info(); }

  std::string opening() const override {
    const SequenceInfo& info = sequence_.info();
    return fmt::format("{} ({}): {} stereo frames of {}x{}{}", info.name, info.layout,
                       sequence_.size(), info.stereo.width, info.stereo.height,
                       info.fisheye ? ", with a fisheye" : "");
  }

  RunResult run(const SlamOptions& options, SessionOptions session, const ReplayHooks& hooks,
                Map map) override {
    ReplayOptions replayed;
    replayed.session = std::move(session);
    replayed.limit = line_.input.limit;
    replayed.rate = line_.rate;
    return replay(source_, options, std::move(replayed), hooks, std::move(map));
  }

  std::string checksum() const override { return source_.checksum(); }
  std::string dataset() const override {
    const InputChoice& input = line_.input;
    return absolute_path(input.footage.left.empty() ? input.dataset : input.footage.left.front());
  }
  const ImageSequence* pictures() override { return &sequence_; }
  nlohmann::ordered_json live() const override { return {}; }

 private:
  const CommandLine& line_;
  const ImageSequence& sequence_;
  const ImageFrameSource images_;
  const ChecksummedSource source_;
};

int run(const CommandLine& line, const Interrupt& interrupt) {
  PreparedRun prepared = prepare_run(line);
  const auto sequence = open_input(line.input);
  begin_outputs(line);
  ReplayInput input(line, *sequence);
  return run_slam(line, std::move(prepared), input, interrupt.token());
}

int run(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "check") {
    return run_check_command(argc - 1, argv + 1);
  }
  if (argc > 1 && std::string_view(argv[1]) == "live") {
    return run_live_command(argc - 1, argv + 1);
  }
  int exit_code = kExitOk;
  const auto line = parse_command_line(argc, argv, exit_code);
  if (!line) return exit_code;
  const Interrupt interrupt;
  return run(*line, interrupt);
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  using namespace hybrid_slam;
  return run_program("hybrid_slam", [&]() -> int {
    silence_solver_log();
    try {
      return run(argc, argv);
    } catch (const AddressError& error) {
      spdlog::error("--view: {}", error.what());
      return kExitBadUsage;
    }
  });
}
