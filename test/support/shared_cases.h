#pragma once

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>

namespace hybrid_slam {

// A folder of files as users have them, beside the shared data. None, with the word that makes the
// test count as skipped, where the data are not there.
inline std::optional<std::filesystem::path> shared_cases(const std::string& folder) {
  const char* const data = std::getenv("HYBRID_SLAM_DATA");
  if (data == nullptr) {
    std::cout << "SKIPPED: HYBRID_SLAM_DATA is not set\n";
    return std::nullopt;
  }
  const auto cases = std::filesystem::path(data) / ".." / "cases" / folder;
  if (!std::filesystem::is_directory(cases)) {
    std::cout << "SKIPPED: there is no " << cases.string() << "\n";
    return std::nullopt;
  }
  return cases;
}

}  // namespace hybrid_slam
