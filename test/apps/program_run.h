#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "test/support/child_process.h"

namespace hybrid_slam {

// Fewer features than the default, for small images and short tests.
std::vector<std::string> slam_arguments(const std::string& dataset,
                                        const std::vector<std::string>& more);

// hybrid_slam in the working folder `folder`.
Outcome run_slam(const std::filesystem::path& folder, const std::string& dataset,
                 const std::vector<std::string>& more = {});

// Lines of `text` that contain `part`.
int count_lines(const std::string& text, const std::string& part = "");

nlohmann::json read_json(const std::filesystem::path& path);

// Checks that an attempt ended with `code`, printed exactly one line to stderr, which names the
// program and contains `reason`, and nothing to stdout.
void check_refused(const Outcome& outcome, int code, const std::string& reason,
                   const std::string& program = "hybrid_slam");

}  // namespace hybrid_slam
