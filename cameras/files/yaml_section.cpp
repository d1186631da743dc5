#include "cameras/files/yaml_section.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <type_traits>
#include <utility>

#include "cameras/files/printable.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kMaxFileSize = 1 << 20;  // [bytes]; calibrations and options have a few kB

std::string read_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text(kMaxFileSize + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (!file.is_open() || file.bad()) throw InputError(path + ": cannot be read");
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.size() > kMaxFileSize) throw InputError(path + ": is larger than 1 MB");
  return text;
}

std::string line_of(const YAML::Mark& mark) { return std::to_string(mark.line + 1); }

}  // namespace

YamlSection::YamlSection(std::string file, std::string prefix, const YAML::Node& node)
    : file_(std::move(file)), prefix_(std::move(prefix)), node_(node) {}

YamlSection YamlSection::read(const std::string& path) {
  std::string text = read_text(path);
  if (text.starts_with("%YAML")) {  // OpenCV's "%YAML:1.0" is not what YAML calls a directive
    const std::size_t end = std::min(text.find('\n'), text.size());
    text.replace(0, end, end, ' ');
  }
  try {
    const YAML::Node root = YAML::Load(text);
    if (!root.IsMap() && !root.IsNull()) {
      throw InputError(path + ":" + line_of(root.Mark()) + ": holds no keys and values");
    }
    return {path, "", root};
  } catch (const YAML::Exception& error) {
    throw InputError(path + ":" + line_of(error.mark) + ": not YAML: " + printable(error.msg));
  }
}

void YamlSection::fail(const std::string& key, const std::string& reason) const {
  const YAML::Node node = node_[key];
  const std::string place = node ? ":" + line_of(node.Mark()) : "";
  throw InputError(file_ + place + ": " + printable(prefix_ + key + ": " + reason));
}

std::vector<std::string> YamlSection::keys() const {
  std::vector<std::string> keys;
  for (const auto& entry : node_) {
    if (entry.first.IsScalar()) keys.push_back(entry.first.Scalar());
  }
  return keys;
}

int YamlSection::line(const std::string& key) const { return required(key).Mark().line + 1; }

void YamlSection::refuse_all_but(const std::set<std::string>& known) const {
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar()) {
      throw InputError(file_ + ":" + line_of(entry.first.Mark()) + ": a key must be a word");
    }
    if (!known.contains(entry.first.Scalar())) fail(entry.first.Scalar(), "unknown key");
  }
}

YamlSection YamlSection::child(const std::string& key) const {
  const YAML::Node node = required(key);
  if (!node.IsMap() && !node.IsNull()) fail(key, "must hold keys and values");
  return {file_, prefix_ + key + ".", node};
}

double YamlSection::number(const std::string& key) const { return value<double>(key); }

std::string YamlSection::text(const std::string& key) const {
  const YAML::Node node = required(key);
  if (!node.IsScalar()) fail(key, "must be a word");
  return node.Scalar();
}

std::vector<double> YamlSection::numbers(const std::string& key, std::size_t count) const {
  return to_numbers(key, required(key), count);
}

std::vector<double> YamlSection::numbers(const std::string& key) const {
  const YAML::Node node = required(key);
  return to_numbers(key, node, node.IsSequence() ? node.size() : 1);
}

std::vector<YamlSection> YamlSection::children(const std::string& key) const {
  const YAML::Node node = required(key);
  if (!node.IsSequence()) fail(key, "must be a list");
  std::vector<YamlSection> result;
  for (const YAML::Node& item : node) {
    if (!item.IsMap()) fail(key, "must be a list of keys and values");
    result.push_back({file_, prefix_ + key + "[" + std::to_string(result.size()) + "].", item});
  }
  return result;
}

std::vector<std::vector<double>> YamlSection::rows(const std::string& key, std::size_t row_count,
                                                   std::size_t col_count) const {
  const YAML::Node node = required(key);
  if (!node.IsSequence() || node.size() != row_count) {
    fail(key, "must have " + std::to_string(row_count) + " rows");
  }
  std::vector<std::vector<double>> result;
  for (const YAML::Node& row : node) result.push_back(to_numbers(key, row, col_count));
  return result;
}

std::vector<double> YamlSection::matrix(const std::string& key, std::size_t rows,
                                        std::size_t cols) const {
  const YamlSection m = child(key);
  if (m.number("rows") != static_cast<double>(rows) ||
      m.number("cols") != static_cast<double>(cols)) {
    fail(key, "must be " + std::to_string(rows) + " x " + std::to_string(cols));
  }
  return m.numbers("data", rows * cols);
}

template <typename T>
T YamlSection::value(const std::string& key) const {
  const YAML::Node node = required(key);
  T result{};
  if (!node.IsScalar() || !YAML::convert<T>::decode(node, result)) {
    const bool is_bool = std::is_same_v<T, bool>;
    const bool is_real = std::is_floating_point_v<T>;
    fail(key, is_bool   ? "must be true or false"
              : is_real ? "must be a number"
                        : "must be a whole number in range");
  }
  if constexpr (std::is_floating_point_v<T>) {
    if (!std::isfinite(result)) fail(key, "is not finite");
  }
  return result;
}

template bool YamlSection::value<bool>(const std::string&) const;
template int YamlSection::value<int>(const std::string&) const;
template double YamlSection::value<double>(const std::string&) const;
template std::uint64_t YamlSection::value<std::uint64_t>(const std::string&) const;

YAML::Node YamlSection::required(const std::string& key) const {
  const YAML::Node node = node_[key];
  if (!node) fail(key, "is missing");
  return node;
}

std::vector<double> YamlSection::to_numbers(const std::string& key, const YAML::Node& node,
                                            std::size_t count) const {
  if (!node.IsSequence() || node.size() != count) {
    fail(key, "must have " + std::to_string(count) + " numbers");
  }
  std::vector<double> result;
  for (const YAML::Node& item : node) {
    double number = 0;
    if (!item.IsScalar() || !YAML::convert<double>::decode(item, number)) {
      fail(key, "must hold numbers only");
    }
    if (!std::isfinite(number)) fail(key, "is not finite");
    result.push_back(number);
  }
  return result;
}

}  // namespace hybrid_slam
