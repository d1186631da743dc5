#include "frontend/input/yaml_file.h"

#include <cmath>

#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& reason) {
  throw InputError(path.string() + ": " + reason);
}

}  // namespace

YAML::Node read_yaml(const std::filesystem::path& path) {
  if (!std::filesystem::is_regular_file(path)) fail(path, "no such file");
  try {
    const YAML::Node root = YAML::LoadFile(path.string());
    if (!root.IsMap()) fail(path, "holds no YAML map");
    return root;
  } catch (const YAML::ParserException& error) {
    throw line_error(path, error.mark.line + 1, "not YAML: " + error.msg);
  } catch (const YAML::Exception& error) {
    fail(path, "cannot be read: " + error.msg);
  }
}

std::vector<double> yaml_numbers(const YAML::Node& map, const std::string& key, std::size_t count,
                                 const std::filesystem::path& path) {
  try {
    const auto values = map[key].as<std::vector<double>>();
    if (values.size() != count) {
      fail(path, key + ": expected " + std::to_string(count) + " numbers, found " +
                     std::to_string(values.size()));
    }
    for (const double value : values) {
      if (!std::isfinite(value)) fail(path, key + ": a value is not finite");
    }
    return values;
  } catch (const YAML::Exception&) {
    fail(path, key + ": missing, or not a list of numbers");
  }
}

std::string yaml_text(const YAML::Node& map, const std::string& key,
                      const std::filesystem::path& path) {
  try {
    return map[key].as<std::string>();
  } catch (const YAML::Exception&) {
    fail(path, key + ": missing, or not text");
  }
}

}  // namespace hybrid_slam
