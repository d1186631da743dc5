#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace hybrid_slam {

// A csv file of a run's results (frames.csv, loops.csv ...): columns by their names. A line that is
// shorter than the header, as the last one of a program that was killed may be, has empty fields at
// its end.
class ResultTable {
 public:
  ResultTable() = default;  // no columns, no rows

  // Throws InputError if the file cannot be read or has no header.
  explicit ResultTable(const std::filesystem::path& path);

  std::size_t size() const { return rows_.size(); }
  bool has(std::string_view column) const;

  // Empty where the table has no such column.
  std::string_view text(std::size_t row, std::string_view column) const;

  // NaN where the field is empty, no number, or there is no such column.
  double number(std::size_t row, std::string_view column) const;

 private:
  std::size_t column_of(std::string_view name) const;

  std::vector<std::string> columns_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace hybrid_slam
