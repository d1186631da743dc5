#include "frontend/input/text_file.h"

#include <charconv>
#include <cmath>
#include <fstream>

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kBlanks = " \t\r";
constexpr std::size_t kMaxQuoted = 40;  // of a bad field, in an error line

std::string_view trim(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

std::ifstream open_file(const fs::path& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) throw InputError(path.string() + ": no such file");
  // Checked before opening: to open a pipe waits for its writer.
  const bool is_regular = fs::is_regular_file(path, ignored);
  std::ifstream file;
  if (is_regular) file.open(path, std::ios::binary);
  if (!file.is_open()) throw InputError(path.string() + ": cannot be read");
  return file;
}

}  // namespace

std::string quote(std::string_view field) {
  std::string quoted(1, '"');
  for (const char c : field.substr(0, kMaxQuoted)) quoted += c >= ' ' && c <= '~' ? c : '?';
  quoted += '"';
  return quoted;
}

InputError line_error(const fs::path& path, int line, std::string_view reason) {
  return InputError(path.string() + ":" + std::to_string(line) + ": " + std::string(reason));
}

std::string read_file(const fs::path& path) {
  std::ifstream file = open_file(path);
  std::error_code error;
  std::string content(fs::file_size(path, error), '\0');
  if (!error) file.read(content.data(), static_cast<std::streamsize>(content.size()));
  if (error || !file) throw InputError(path.string() + ": reading failed");
  return content;
}

std::vector<TextLine> read_lines(const fs::path& path) {
  std::ifstream file = open_file(path);
  std::vector<TextLine> lines;
  std::string text;
  for (int number = 1; std::getline(file, text); ++number) {
    const std::string_view content = trim(text);
    if (content.empty() || content.front() == '#') continue;
    lines.push_back({number, std::string(content)});
  }
  if (file.bad()) throw InputError(path.string() + ": reading failed");
  return lines;
}

std::vector<std::string_view> split_fields(std::string_view text, char separator) {
  std::vector<std::string_view> fields;
  if (separator == ' ') {
    constexpr std::string_view kSeparators = " \t\r,";
    std::size_t begin = text.find_first_not_of(kSeparators);
    while (begin != std::string_view::npos) {
      const std::size_t end = std::min(text.find_first_of(kSeparators, begin), text.size());
      fields.push_back(text.substr(begin, end - begin));
      begin = text.find_first_not_of(kSeparators, end);
    }
    return fields;
  }
  std::size_t begin = 0;
  while (true) {
    const std::size_t end = text.find(separator, begin);
    fields.push_back(trim(text.substr(begin, end - begin)));
    if (end == std::string_view::npos) return fields;
    begin = end + 1;
  }
}

double parse_number(std::string_view field, const fs::path& path, int line) {
  std::string_view digits = field;
  if (digits.size() > 1 && digits[0] == '+' && digits[1] != '-') digits.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  // A number too small for a double is read as zero, as its writer meant it.
  if (error == std::errc::result_out_of_range && digits.find("e-") != std::string_view::npos) {
    return 0;
  }
  if (error != std::errc() || end != digits.data() + digits.size()) {
    throw line_error(path, line, quote(field) + " is not a number");
  }
  if (!std::isfinite(value)) throw line_error(path, line, quote(field) + " is not finite");
  return value;
}

std::vector<NumberRow> read_number_rows(const fs::path& path, char separator) {
  std::vector<NumberRow> rows;
  for (const TextLine& line : read_lines(path)) {
    NumberRow row{line.number, {}};
    for (const std::string_view field : split_fields(line.text, separator)) {
      row.values.push_back(parse_number(field, path, line.number));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

std::vector<double> read_times(const fs::path& path) {
  std::vector<double> times;
  for (const NumberRow& row : read_number_rows(path, ' ')) {
    if (row.values.size() != 1) throw line_error(path, row.line, "expected one time per line");
    if (!times.empty() && !(row.values[0] > times.back())) {
      throw line_error(path, row.line, "times are not strictly ascending");
    }
    times.push_back(row.values[0]);
  }
  if (times.empty()) throw InputError(path.string() + ": holds no times");
  return times;
}

}  // namespace hybrid_slam
