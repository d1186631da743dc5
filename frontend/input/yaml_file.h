#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "cameras/input_error.h"

namespace hybrid_slam {

// Throws InputError if the file is missing, is not YAML or is not a map.
YAML::Node read_yaml(const std::filesystem::path& path);

// `key` of a map, as `count` finite numbers or as text. Throws InputError naming file and key.
std::vector<double> yaml_numbers(const YAML::Node& map, const std::string& key, std::size_t count,
                                 const std::filesystem::path& path);
std::string yaml_text(const YAML::Node& map, const std::string& key,
                      const std::filesystem::path& path);

}  // namespace hybrid_slam
