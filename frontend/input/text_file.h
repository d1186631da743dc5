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

// "path:line: reason", the way every reader of text here complains.
InputError line_error(const std::filesystem::path& path, int line, std::string_view reason);

// A piece of a file as it may stand in an error line: in quotes, printable, not too long.
std::string quote(std::string_view field);

// The whole content, binary or text. Throws InputError if the file cannot be read.
std::string read_file(const std::filesystem::path& path);

// Throws InputError if the file cannot be read.
std::vector<TextLine> read_lines(const std::filesystem::path& path);

// The fields of a line. ' ' stands for any run of white space (or commas); another separator
// delimits exactly, and the fields come without surrounding blanks.
std::vector<std::string_view> split_fields(std::string_view text, char separator);

// Throws InputError unless `field` is one finite number.
double parse_number(std::string_view field, const std::filesystem::path& path, int line);

// Every line as numbers. Throws InputError if the file cannot be read or a field is not a finite
// number.
std::vector<NumberRow> read_number_rows(const std::filesystem::path& path, char separator);

// One time per line [s], strictly ascending (anything after the first column is refused).
// Throws InputError with the line where it is not so.
std::vector<double> read_times(const std::filesystem::path& path);

}  // namespace hybrid_slam
