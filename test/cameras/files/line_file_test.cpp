#include "cameras/files/line_file.h"

#include <filesystem>
#include <fstream>
#include <sstream>

#include <catch2/catch.hpp>

#include "cameras/files/output_file.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

TEST_CASE("Each line is in the file at once, and an older file is gone") {
  const TempFolder folder;
  const auto path = folder.path() / "lines.csv";
  write_file(path, "old\n");
  LineFile file(path);
  CHECK(read_text(path).empty());
  CHECK(file.append("first").empty());
  CHECK(read_text(path) == "first\n");
  LineFile moved(std::move(file));
  CHECK(moved.append("second").empty());
  CHECK(read_text(path) == "first\nsecond\n");
  CHECK(moved.left_out() == 0);
}

TEST_CASE("A full disk is said once, and lines are left out") {
  LineFile file("/dev/full");
  const std::string failure = file.append("a line");
  CHECK(failure == "/dev/full: No space left on device; lines are left out");
  CHECK(file.append("another").empty());
  CHECK(file.left_out() == 2);
}

TEST_CASE("A line file that cannot be made is an output error, one of no name takes lines") {
  CHECK_THROWS_AS(LineFile("/nowhere/lines.csv"), OutputError);
  LineFile none;
  CHECK(none.append("lost").empty());
}

}  // namespace
}  // namespace hybrid_slam
