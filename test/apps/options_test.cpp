#include <set>
#include <string>

#include <yaml-cpp/yaml.h>

#include <catch2/catch.hpp>

#include "apps/slam/slam_options.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

// The YAML block of docs/options.md.
std::string documented_options() {
  const std::string text = read_text(SOURCE_FOLDER "/docs/options.md");
  const std::string fence = "```yaml\n";
  const std::size_t begin = text.find(fence);
  REQUIRE(begin != std::string::npos);
  const std::size_t end = text.find("```", begin + fence.size());
  REQUIRE(end != std::string::npos);
  return text.substr(begin + fence.size(), end - begin - fence.size());
}

void collect_keys(const YAML::Node& node, const std::string& path, std::set<std::string>& keys) {
  if (!node.IsMap()) {
    CHECK(keys.insert(path).second);
    return;
  }
  for (const auto& entry : node) {
    collect_keys(entry.second, path + "/" + entry.first.as<std::string>(), keys);
  }
}

// The path of every value in a YAML text.
std::set<std::string> keys_of(const std::string& text) {
  std::set<std::string> keys;
  collect_keys(YAML::Load(text), "", keys);
  return keys;
}

SlamOptions read_documented() {
  const TempFolder folder;
  write_text(folder.path() / "options.yaml", documented_options());
  return read_slam_options((folder.path() / "options.yaml").string());
}

TEST_CASE("docs/options.md gives every key, no other, and the defaults") {
  const std::string defaults = write_slam_options(SlamOptions());
  CHECK(keys_of(defaults).size() > 60);
  CHECK(keys_of(documented_options()) == keys_of(defaults));
  CHECK(write_slam_options(read_documented()) == defaults);
}

TEST_CASE("written options are read again exactly, every key of them") {
  SlamOptions options;
  options.features = 1234;
  options.seed = ~std::uint64_t{0};
  options.stereo.ratio = 1.0 / 3;
  options.fisheye.view.mask = "a: mask #1.png";
  options.upsampling = Upsampling::kOff;
  options.tracking.refinement.sigma = 0.1;
  options.backend.local_method = LocalMethod::kBundle;
  const std::string text = write_slam_options(options);
  const TempFolder folder;
  write_text(folder.path() / "options.yaml", text);
  const SlamOptions read = read_slam_options((folder.path() / "options.yaml").string());
  CHECK(read.features == 1234);
  CHECK(read.seed == ~std::uint64_t{0});
  CHECK(read.stereo.ratio == 1.0 / 3);
  CHECK(read.fisheye.view.mask == "a: mask #1.png");
  CHECK_FALSE(read.sift.upsample);
  CHECK(read.backend.local_method == LocalMethod::kBundle);
  CHECK(write_slam_options(read) == text);
  CHECK(keys_of(text) == keys_of(documented_options()));
}

}  // namespace
}  // namespace hybrid_slam
