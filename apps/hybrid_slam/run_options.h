#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "apps/hybrid_slam/command_line.h"

namespace hybrid_slam {

// What --help says of the files of a run.
extern const char* const kWrittenFiles;

// A check of an option's text, with what to say of one that fails.
CLI::Validator must_be(bool (*check)(const std::string&), const std::string& complaint);

// CLI's own checks let NaN pass.
bool is_rate(const std::string& text);

// The options of every run, wherever its images come from: declared when this is made, which must
// live until they are read.
class RunOptions {
 public:
  // --help says what `line` has by default.
  RunOptions(CLI::App& app, CommandLine& line);

  // Reads the command line into all that `app` declares. `check`: throws CLI::ValidationError where
  // the caller's own options do not go together. The exit code, if the program shall end at once
  // (help, or bad usage, which has been reported). Throws InputError for the configuration file.
  std::optional<int> read(int argc, char** argv, const std::function<void()>& check);

 private:
  void add_view(CLI::App& app);
  void check() const;
  bool settle();

  CLI::App& app_;
  CommandLine& line_;
  std::string config_;
  std::string device_ = "auto";
  std::optional<int> features_;
  std::optional<std::uint64_t> seed_;
  std::optional<bool> loops_;
  CLI::Option* log_level_ = nullptr;
  CLI::Option* view_ = nullptr;
  CLI::Option* view_address_ = nullptr;
};

}  // namespace hybrid_slam
