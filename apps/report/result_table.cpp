#include "apps/report/result_table.h"

#include <algorithm>
#include <charconv>
#include <limits>

#include "frontend/input/text_file.h"

namespace hybrid_slam {
namespace {

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields;
  for (const std::string_view field : split_fields(line, ',')) fields.emplace_back(field);
  return fields;
}

}  // namespace

ResultTable::ResultTable(const std::filesystem::path& path) {
  const std::vector<TextLine> lines = read_lines(path);
  if (lines.empty()) throw InputError(path.string() + ": no header");
  columns_ = fields_of(lines.front().text);
  for (auto line = lines.begin() + 1; line != lines.end(); ++line) {
    rows_.push_back(fields_of(line->text));
  }
}

std::size_t ResultTable::column_of(std::string_view name) const {
  const auto found = std::find(columns_.begin(), columns_.end(), name);
  return static_cast<std::size_t>(found - columns_.begin());
}

bool ResultTable::has(std::string_view column) const { return column_of(column) < columns_.size(); }

std::string_view ResultTable::text(std::size_t row, std::string_view column) const {
  const std::size_t at = column_of(column);
  const std::vector<std::string>& fields = rows_.at(row);
  return at < fields.size() ? std::string_view(fields[at]) : std::string_view();
}

double ResultTable::number(std::size_t row, std::string_view column) const {
  const std::string_view field = text(row, column);
  double value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  const bool whole = error == std::errc() && end == field.data() + field.size() && !field.empty();
  return whole ? value : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace hybrid_slam
