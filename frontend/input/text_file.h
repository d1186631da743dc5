#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "cameras/files/input_error.h"

namespace hybrid_slam {

// A line of a text file that holds something: neither empty nor a comment (#).
struct TextLine {
  int number = 0;    // counted from 1
  std::string text;  // without the end of line, "\r" included
};

// A line of numbers.
struct NumberRow {
  int line = 0;  // counted from 1
  std::vector<double> values;
};

// Lines of numbers, and what stands above them.
struct NumberTable {
  std::string header;     // the first line of words, or the last comment before the rows; may be ""
  std::string first_row;  // as it is written
  std::vector<NumberRow> rows;
};

// "path:line: reason", the way every reader of text here complains.
InputError line_error(const std::filesystem::path& path, int line, std::string_view reason);

// A piece of a file as it may stand in an error line: in quotes, printable, not too long.
std::string quote(std::string_view field);

// The whole content, binary or text. Throws InputError if the file cannot be read.
std::string read_file(const std::filesystem::path& path);

// The whole content of a text file, without a byte order mark. Throws InputError if the file cannot
// be read or is UTF-16.
std::string read_text_file(const std::filesystem::path& path);

// Throws InputError as read_text_file does.
std::vector<TextLine> read_lines(const std::filesystem::path& path);

// The fields of a line. ' ' stands for any run of white space (or commas); another separator
// delimits exactly, and the fields come without surrounding blanks and quotes. A separator at the
// end of the line begins no field.
std::vector<std::string_view> split_fields(std::string_view text, char separator);

// Whether a line of numbers has a comma for the decimal point: "0,5 1,25".
bool has_decimal_commas(std::string_view text);

// Throws InputError unless `field` is one finite number.
double parse_number(std::string_view field, const std::filesystem::path& path, int line);

// Every line as numbers; the first may be words that name the columns. Throws InputError if the
// file cannot be read, has decimal commas, or a field is not a finite number.
NumberTable read_number_table(const std::filesystem::path& path, char separator);
std::vector<NumberRow> read_number_rows(const std::filesystem::path& path, char separator);

// Beyond this a time is in nanoseconds: as seconds it would be three million years.
inline constexpr double kLeastNanoseconds = 1e14;

// One time per line [s], strictly ascending (anything after the first column is refused). Times in
// nanoseconds become seconds, with a line in `warnings`. Throws InputError with the line where it
// is not so.
std::vector<double> read_times(const std::filesystem::path& path,
                               std::vector<std::string>& warnings);

}  // namespace hybrid_slam
