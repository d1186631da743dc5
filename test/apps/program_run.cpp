#include "test/apps/program_run.h"

#include <sstream>

#include <catch2/catch.hpp>

#include "test/support/temp_folder.h"

namespace hybrid_slam {

std::vector<std::string> slam_arguments(const std::string& dataset,
                                        const std::vector<std::string>& more) {
  std::vector<std::string> arguments{dataset, "--features", "400"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

Outcome run_slam(const std::filesystem::path& folder, const std::string& dataset,
                 const std::vector<std::string>& more) {
  return run_program(HYBRID_SLAM, slam_arguments(dataset, more), folder);
}

int count_lines(const std::string& text, const std::string& part) {
  std::istringstream lines(text);
  std::string line;
  int count = 0;
  while (std::getline(lines, line)) count += line.find(part) != std::string::npos ? 1 : 0;
  return count;
}

nlohmann::json read_json(const std::filesystem::path& path) {
  return nlohmann::json::parse(read_text(path));
}

void check_refused(const Outcome& outcome, int code, const std::string& reason,
                   const std::string& program) {
  INFO("stderr: " << outcome.err);
  INFO("expected: " << reason);
  CHECK(outcome.code == code);
  CHECK(count_lines(outcome.err) == 1);
  CHECK(count_lines(outcome.err, program + ": ") == 1);
  CHECK(count_lines(outcome.err, reason) == 1);
  CHECK(outcome.out.empty());
}

}  // namespace hybrid_slam
