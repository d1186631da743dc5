#pragma once

#include <functional>
#include <optional>
#include <string>

namespace CLI {
class App;
}

// What every program does alike: its exit codes, its one line per error, its command line's end,
// --version, the first Ctrl-C, commands that it prints.

namespace hybrid_slam {

// Exit codes that all programs share, as --help lists them. A program's own begin at 4.
enum ExitCode : int {
  kExitOk = 0,
  kExitInternalError = 1,
  kExitBadUsage = 2,
  kExitBadInput = 3,
  kExitInterrupted = 130
};

// Runs a program's body and returns its exit code. What the body throws becomes one line on stderr:
// InputError and OutputError kExitBadInput, all others kExitInternalError. Messages through spdlog
// begin with `name` from here on.
int run_program(const std::string& name, const std::function<int()>& body);

// Parses the command line, then calls `check`, which may throw CLI::ValidationError where values do
// not go together. Empty if the program shall go on, else the exit code to end with: --help,
// --version, or bad usage, which has been reported.
std::optional<int> parse_line(CLI::App& app, int argc, char** argv,
                              const std::function<void()>& check = {});

// For programs of one thread that look now and then: the first SIGINT or SIGTERM after
// watch_signals() ends the run in order, a second one kills the program as usual.
void watch_signals();
bool interrupted();

// As a shell (POSIX) takes it for one word of a command: in quotes where it needs them.
std::string shell_word(const std::string& word);

}  // namespace hybrid_slam
