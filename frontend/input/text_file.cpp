#include "frontend/input/text_file.h"

#include <algorithm>
#include <cctype>
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

std::string_view unquote(std::string_view field) {
  const bool quoted = field.size() > 1 && field.front() == '"' && field.back() == '"';
  return quoted ? field.substr(1, field.size() - 2) : field;
}

constexpr double kMostSeconds = 9.2e9;  // in nanoseconds they fit into 64 bits

bool is_digit(char c) { return c >= '0' && c <= '9'; }

// Words that name columns: no field begins as a number does, or is one.
bool is_header(const std::vector<std::string_view>& fields) {
  return fields.size() > 1 && std::all_of(fields.begin(), fields.end(), [](std::string_view field) {
           return !field.empty() && std::isalpha(static_cast<unsigned char>(field[0])) != 0 &&
                  !field.starts_with("nan") && !field.starts_with("inf");
         });
}

// A comma with a digit on both sides, and the only one.
bool has_decimal_comma(std::string_view field) {
  const std::size_t comma = field.find(',');
  return comma != std::string_view::npos && comma > 0 && comma + 1 < field.size() &&
         field.find(',', comma + 1) == std::string_view::npos && is_digit(field[comma - 1]) &&
         is_digit(field[comma + 1]);
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

// `comment`: the last one before the first line.
std::vector<TextLine> read_lines_and_comment(const fs::path& path, std::string& comment) {
  const std::string content = read_text_file(path);
  std::vector<TextLine> lines;
  std::size_t begin = 0;
  for (int number = 1; begin < content.size(); ++number) {
    const std::size_t end = std::min(content.find('\n', begin), content.size());
    const std::string_view text = trim(std::string_view(content).substr(begin, end - begin));
    if (text.starts_with('#')) {
      if (lines.empty()) comment = text;
    } else if (!text.empty()) {
      lines.push_back({number, std::string(text)});
    }
    begin = end + 1;
  }
  return lines;
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

std::string read_text_file(const fs::path& path) {
  constexpr std::string_view kUtf8Mark = "\xEF\xBB\xBF";
  std::string content = read_file(path);
  const std::string_view start = std::string_view(content).substr(0, 2);
  // Without its mark, UTF-16 shows by the zero in each of its first letters.
  if (start == "\xFF\xFE" || start == "\xFE\xFF" ||
      (start.size() == 2 && (start[0] == '\0') != (start[1] == '\0'))) {
    throw InputError(path.string() +
                     ": is UTF-16 text; save it as UTF-8 (iconv -f UTF-16 -t UTF-8)");
  }
  if (content.starts_with(kUtf8Mark)) content.erase(0, kUtf8Mark.size());
  return content;
}

std::vector<TextLine> read_lines(const fs::path& path) {
  std::string ignored;
  return read_lines_and_comment(path, ignored);
}

std::vector<std::string_view> split_fields(std::string_view text, char separator) {
  std::vector<std::string_view> fields;
  if (separator == ' ') {
    constexpr std::string_view kSeparators = " \t\r,";
    std::size_t begin = text.find_first_not_of(kSeparators);
    while (begin != std::string_view::npos) {
      const std::size_t end = std::min(text.find_first_of(kSeparators, begin), text.size());
      fields.push_back(unquote(text.substr(begin, end - begin)));
      begin = text.find_first_not_of(kSeparators, end);
    }
    return fields;
  }
  std::size_t begin = 0;
  while (true) {
    const std::size_t end = text.find(separator, begin);
    fields.push_back(unquote(trim(text.substr(begin, end - begin))));
    if (end == std::string_view::npos) break;
    begin = end + 1;
  }
  if (fields.size() > 1 && fields.back().empty()) fields.pop_back();
  return fields;
}

bool has_decimal_commas(std::string_view text) {
  std::size_t decimal = 0;
  std::size_t begin = text.find_first_not_of(kBlanks);
  while (begin != std::string_view::npos) {
    const std::size_t end = std::min(text.find_first_of(kBlanks, begin), text.size());
    const std::string_view field = text.substr(begin, end - begin);
    if (has_decimal_comma(field)) {
      ++decimal;
    } else if (field.find(',') != std::string_view::npos) {
      return false;  // a list
    }
    begin = text.find_first_not_of(kBlanks, end);
  }
  return decimal > 1;
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

NumberTable read_number_table(const fs::path& path, char separator) {
  NumberTable table;
  const std::vector<TextLine> lines = read_lines_and_comment(path, table.header);
  for (const TextLine& line : lines) {
    if (has_decimal_commas(line.text)) {
      throw line_error(path, line.number, "decimal commas; write numbers with a point");
    }
    const std::vector<std::string_view> fields = split_fields(line.text, separator);
    if (&line == &lines.front() && is_header(fields)) {
      table.header = line.text;
      continue;
    }
    if (table.rows.empty()) table.first_row = line.text;
    NumberRow row{line.number, {}};
    for (const std::string_view field : fields) {
      row.values.push_back(parse_number(field, path, line.number));
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::vector<NumberRow> read_number_rows(const fs::path& path, char separator) {
  return read_number_table(path, separator).rows;
}

std::vector<double> read_times(const fs::path& path, std::vector<std::string>& warnings) {
  std::vector<double> times;
  for (const NumberRow& row : read_number_rows(path, ' ')) {
    if (row.values.size() != 1) throw line_error(path, row.line, "expected one time per line");
    if (!times.empty() && !(row.values[0] > times.back())) {
      throw line_error(path, row.line, "times are not strictly ascending");
    }
    times.push_back(row.values[0]);
  }
  if (times.empty()) throw InputError(path.string() + ": holds no times");
  const bool nanoseconds = times.back() >= kLeastNanoseconds;
  const double most = nanoseconds ? 1e9 * kMostSeconds : kMostSeconds;
  if (times.front() < -most || times.back() > most) {
    throw InputError(path.string() + ": holds times of more than 292 years");
  }
  if (nanoseconds) {
    warnings.push_back(path.string() + ": read as nanoseconds: " +
                       std::to_string(static_cast<std::int64_t>(times.back())) +
                       " is too much for seconds");
    for (double& time : times) time *= 1e-9;
  }
  return times;
}

}  // namespace hybrid_slam
