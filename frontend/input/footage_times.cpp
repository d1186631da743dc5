#include "frontend/input/footage_times.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "frontend/input/kitti_calibration.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

bool is_date(std::string_view text) {
  return text.size() > 10 && text[4] == '-' && text[7] == '-' && text[10] == ' ';
}

// Whether the first line says that times are in nanoseconds, as EuRoC's data.csv does.
bool says_nanoseconds(const fs::path& path) {
  const std::string text = read_text_file(path);
  return text.substr(0, text.find('\n')).find("[ns]") != std::string::npos;
}

// Whether the lines are "name time ..." (4Seasons, TUM's monocular dataset): of the last one the
// first word is an image's name, the second is none.
bool begins_with_names(const std::vector<TextLine>& lines, const std::vector<fs::path>& left) {
  const std::vector<std::string_view> fields = split_fields(lines.back().text, ' ');
  const auto is_name = [&](const fs::path& word) {
    return std::any_of(left.begin(), left.end(),
                       [&](const fs::path& image) { return image.stem() == word.stem(); });
  };
  return fields.size() > 1 && is_name(fields[0]) && !is_name(fields[1]);
}

// "time name" or "name time", in any of the usual units: by the name without its folder and ending.
std::map<std::string, double> read_named_times(const fs::path& path,
                                               const std::vector<fs::path>& left,
                                               std::vector<std::string>& warnings) {
  std::map<std::string, double> times;
  bool nanoseconds = says_nanoseconds(path);
  const std::vector<TextLine> lines = read_lines(path);
  const std::size_t name_at = begins_with_names(lines, left) ? 0 : 1;
  for (const TextLine& line : lines) {
    const std::vector<std::string_view> fields = split_fields(line.text, ' ');
    if (fields.size() < 2) throw line_error(path, line.number, "expected a time and a name");
    const std::string_view field = fields[1 - name_at];
    const bool is_row = field.find_first_not_of("0123456789.+-eE") == std::string_view::npos;
    if (!is_row && times.empty()) continue;  // the columns' names
    double time = parse_number(field, path, line.number);
    if (times.empty() && time >= kLeastNanoseconds) nanoseconds = true;
    if (nanoseconds) time *= 1e-9;
    if (!times.emplace(fs::path(fields[name_at]).stem().string(), time).second) {
      throw line_error(path, line.number, quote(fields[name_at]) + " has a time already");
    }
  }
  if (nanoseconds) warnings.push_back(path.string() + ": read as nanoseconds");
  return times;
}

bool has_names(const fs::path& path) {
  const std::vector<TextLine> lines = read_lines(path);
  return !lines.empty() && split_fields(lines.back().text, ' ').size() > 1 &&
         !is_date(lines.back().text);
}

std::vector<double> by_names(const fs::path& path, const std::vector<fs::path>& left,
                             std::vector<std::string>& warnings) {
  const std::map<std::string, double> named = read_named_times(path, left, warnings);
  std::vector<double> times;
  for (const fs::path& image : left) {
    const auto found = named.find(image.stem().string());
    if (found == named.end()) {
      throw InputError(path.string() + ": has no time of the left image " +
                       quote(image.filename().string()));
    }
    times.push_back(found->second);
  }
  return times;
}

std::vector<double> by_rows(const fs::path& path, const std::vector<std::int64_t>& numbers,
                            std::vector<std::string>& warnings) {
  const bool dates = is_date(read_lines(path).empty() ? "" : read_lines(path).front().text);
  const std::vector<double> rows = dates ? read_kitti_timestamps(path) : read_times(path, warnings);
  if (rows.size() == numbers.size()) return rows;
  const auto count = static_cast<std::int64_t>(rows.size());
  if (numbers.front() < 0 || numbers.back() >= count) {
    throw InputError(path.string() + ": has " + std::to_string(rows.size()) + " times for " +
                     std::to_string(numbers.size()) + " frames of numbers " +
                     std::to_string(numbers.front()) + " to " + std::to_string(numbers.back()));
  }
  warnings.push_back(path.string() + ": has " + std::to_string(rows.size()) + " times for " +
                     std::to_string(numbers.size()) +
                     " frames; row n is taken for the images of number n, counted from 0");
  std::vector<double> times;
  for (const std::int64_t number : numbers) {
    times.push_back(rows[static_cast<std::size_t>(number)]);
  }
  return times;
}

}  // namespace

std::vector<double> times_by_file(const std::string& path, const std::vector<fs::path>& left,
                                  const std::vector<std::int64_t>& numbers,
                                  std::vector<std::string>& warnings) {
  const std::vector<double> times =
      has_names(path) ? by_names(path, left, warnings) : by_rows(path, numbers, warnings);
  constexpr double kMostSeconds = 9.2e9;  // in nanoseconds they fit into 64 bits
  for (const double time : times) {
    if (std::abs(time) > kMostSeconds)
      throw InputError(path + ": holds times of more than 292 years");
  }
  for (std::size_t i = 1; i < times.size(); ++i) {
    if (times[i] > times[i - 1]) continue;
    throw InputError(path + ": the times of frames " + std::to_string(i - 1) + " and " +
                     std::to_string(i) + " do not ascend");
  }
  return times;
}

}  // namespace hybrid_slam
