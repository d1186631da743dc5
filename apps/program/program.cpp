#include "apps/program/program.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <string_view>

#include "apps/slam/version.h"
#include "cameras/files/input_error.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

std::atomic<bool> signalled = false;
static_assert(std::atomic<bool>::is_always_lock_free, "set by a signal handler");

void on_signal(int signal) {
  signalled = true;
  std::signal(signal, SIG_DFL);
}

}  // namespace

int run_program(const std::string& name, const std::function<int()>& body) {
  spdlog::set_default_logger(spdlog::stderr_color_mt(name));
  spdlog::set_pattern("%n: %^%l%$: %v");
  try {
    return body();
  } catch (const InputError& error) {
    spdlog::error("{}", error.what());
    return kExitBadInput;
  } catch (const OutputError& error) {
    spdlog::error("{}", error.what());
    return kExitBadInput;
  } catch (const std::exception& error) {
    spdlog::critical("internal error: {}", error.what());
    return kExitInternalError;
  }
}

std::optional<int> parse_line(CLI::App& app, int argc, char** argv,
                              const std::function<void()>& check) {
  app.set_version_flag("--version", app.get_name() + ' ' + kVersion + "\ncommit " + kGitCommit +
                                        "\nfeatures " + kFeatures);
  try {
    app.parse(argc, argv);
    if (check) check();
    return std::nullopt;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    spdlog::error("{} (--help tells more)", error.what());
    return kExitBadUsage;
  }
}

void watch_signals() {
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
}

bool interrupted() { return signalled; }

std::string shell_word(const std::string& word) {
  constexpr std::string_view kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./+:,@%";
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string::npos) return word;
  std::string quoted = "'";
  for (const char letter : word) {
    if (letter == '\'') quoted += "'\\'";  // ends the quotes, is quoted itself, begins new ones
    quoted += letter;
  }
  return quoted + "'";
}

}  // namespace hybrid_slam
