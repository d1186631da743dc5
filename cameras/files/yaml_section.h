#pragma once

#include <set>
#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "cameras/files/input_error.h"

namespace hybrid_slam {

// A mapping of a YAML file that knows where it stands. Whatever is wrong is thrown as InputError of
// one line, "file:line: key: reason", without the line where there is none.
class YamlSection {
 public:
  // The whole file; one that is empty holds no keys. OpenCV's "%YAML:1.0" is understood.
  static YamlSection read(const std::string& path);

  [[noreturn]] void fail(const std::string& key, const std::string& reason) const;

  bool has(const std::string& key) const { return static_cast<bool>(node_[key]); }
  bool has_section(const std::string& key) const { return has(key) && node_[key].IsMap(); }
  std::vector<std::string> keys() const;   // in the file's order
  int line(const std::string& key) const;  // of its value, counted from 1
  void refuse_all_but(const std::set<std::string>& known) const;

  // All below: `key` must be there. Numbers must be finite.

  YamlSection child(const std::string& key) const;  // a key without a value: an empty section
  double number(const std::string& key) const;
  std::string text(const std::string& key) const;
  std::vector<double> numbers(const std::string& key, std::size_t count) const;
  std::vector<double> numbers(const std::string& key) const;        // however many
  std::vector<YamlSection> children(const std::string& key) const;  // of a list of sections
  std::vector<std::vector<double>> rows(const std::string& key, std::size_t row_count,
                                        std::size_t col_count) const;

  // rows, cols and data, as ROS and OpenCV write a matrix.
  std::vector<double> matrix(const std::string& key, std::size_t rows, std::size_t cols) const;

  // T: bool, int, double or std::uint64_t.
  template <typename T>
  T value(const std::string& key) const;

 private:
  YamlSection(std::string file, std::string prefix, const YAML::Node& node);

  YAML::Node required(const std::string& key) const;
  std::vector<double> to_numbers(const std::string& key, const YAML::Node& node,
                                 std::size_t count) const;

  std::string file_;
  std::string prefix_;  // of the keys, in messages: those of the sections around, with dots
  YAML::Node node_;     // a map or null
};

}  // namespace hybrid_slam
