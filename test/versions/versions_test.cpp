#include <cstdio>
#include <filesystem>
#include <sstream>
#include <string>

#include <yaml-cpp/yaml.h>

#include <catch2/catch.hpp>

#include "apps/slam/slam_options.h"
#include "apps/slam/version.h"
#include "backend/map/map_file.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

// Every value of `old` is in `now` as it is; keys that came later may be there.
void check_kept(const YAML::Node& old, const YAML::Node& now, const std::string& path) {
  INFO(path);
  REQUIRE(now.IsDefined());
  if (!old.IsMap()) {
    CHECK(YAML::Dump(old) == YAML::Dump(now));
    return;
  }
  for (const auto& entry : old) {
    const std::string key = entry.first.as<std::string>();
    check_kept(entry.second, now[key], path + "/" + key);
  }
}

TEST_CASE("options of 0.1.0 are read, every one of them") {
  const std::string file = VERSIONS "/0.1.0.yaml";
  const YAML::Node old = YAML::LoadFile(file);
  const SlamOptions options = read_slam_options(file);
  CHECK(options.features == 250);
  CHECK(options.seed == 7);
  CHECK(old.size() > 5);
  check_kept(old, YAML::Load(write_slam_options(options)), "");
}

TEST_CASE("a map of 0.1.0 is read, with the options that made it") {
  const LoadedMap loaded = load_map(VERSIONS "/0.1.0.hslam");
  CHECK(loaded.info.program.starts_with("hybrid_slam 0.1.0"));
  const TempFolder folder;
  write_text(folder.path() / "options.yaml", loaded.info.options);
  CHECK(read_slam_options((folder.path() / "options.yaml").string()).features == 250);
  const MapSnapshot& map = loaded.map.view();
  CHECK(map.keyframe_count() == 3);
  CHECK(map.landmark_count() == 183);
}

// What a program prints.
std::string printed(const std::string& command) {
  std::string text;
  FILE* const pipe = popen(command.c_str(), "r");
  REQUIRE(pipe != nullptr);
  char buffer[256];
  while (std::fgets(buffer, sizeof buffer, pipe) != nullptr) text += buffer;
  CHECK(pclose(pipe) == 0);
  return text;
}

TEST_CASE("The program says the version of the headers with --version") {
  CHECK(std::string(kVersion) == PROJECT_VERSION);
  std::ostringstream numbers;
  numbers << HYBRID_SLAM_VERSION_MAJOR << '.' << HYBRID_SLAM_VERSION_MINOR << '.'
          << HYBRID_SLAM_VERSION_PATCH;
  CHECK(numbers.str() == PROJECT_VERSION);
  CHECK(std::string(kFeatures).find("cuda") != std::string::npos);
  std::ostringstream lines;
  lines << "hybrid_slam " << kVersion << "\ncommit " << kGitCommit << "\nfeatures " << kFeatures
        << '\n';
  CHECK(printed(HYBRID_SLAM " --version") == lines.str());
}

}  // namespace
}  // namespace hybrid_slam
