#include "apps/hybrid_slam/provenance.h"

#include <fmt/format.h>
#include <xxhash.h>
#include <yaml-cpp/yaml.h>

#include <map>
#include <nlohmann/json.hpp>

#include "apps/slam/slam_options.h"

namespace hybrid_slam {
namespace {

void add_image(std::uint64_t& checksum, const GrayImage& image) {
  checksum = XXH3_64bits_withSeed(image.pixels.data(), image.pixels.size(),
                                  checksum ^ static_cast<std::uint64_t>(image.width));
}

void add_values(const YAML::Node& node, const std::string& name,
                std::map<std::string, std::string>& values) {
  if (!node.IsMap()) {
    values[name] = YAML::Dump(node);
    return;
  }
  for (const auto& entry : node) {
    const auto key = entry.first.as<std::string>();
    add_values(entry.second, name.empty() ? key : name + "." + key, values);
  }
}

std::map<std::string, std::string> values_of(const std::string& options) {
  std::map<std::string, std::string> values;
  add_values(YAML::Load(options), "", values);
  return values;
}

}  // namespace

std::uint64_t checksum_of(const Moment& moment) {
  std::uint64_t checksum = 1;
  for (const SensorInput& input : moment.inputs) {
    const Nanoseconds time = time_of(input);
    checksum = XXH3_64bits_withSeed(&time, sizeof(time), checksum);
    if (const auto* const pair = std::get_if<StereoImages>(&input)) {
      add_image(checksum, pair->left);
      add_image(checksum, pair->right);
    } else if (const auto* const fisheye = std::get_if<FisheyeImage>(&input)) {
      add_image(checksum, fisheye->image);
    }
  }
  return checksum;
}

std::string checksum_of(const std::vector<std::uint64_t>& moments) {
  return fmt::format("{:016x}",
                     XXH3_64bits(moments.data(), moments.size() * sizeof(std::uint64_t)));
}

Moment ChecksummedSource::read(std::size_t index) const {
  Moment moment = source_.read(index);
  checksums_[index] = checksum_of(moment);
  return moment;
}

nlohmann::ordered_json changed_options(const std::string& options) {
  SlamOptions defaults;
  defaults.distribute();
  const auto usual = values_of(write_slam_options(defaults));
  nlohmann::ordered_json changed = nlohmann::ordered_json::object();
  for (const auto& [name, value] : values_of(options)) {
    const auto found = usual.find(name);
    if (found == usual.end() || found->second != value) changed[name] = value;
  }
  return changed;
}

}  // namespace hybrid_slam
