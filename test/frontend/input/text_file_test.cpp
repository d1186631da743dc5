#include "frontend/input/text_file.h"

#include <catch2/catch.hpp>

#include "test/frontend/input/dataset_writer.h"

namespace hybrid_slam {
namespace {

TEST_CASE("rows of numbers, comments and Windows line ends") {
  const TempFolder folder;
  const auto path = folder.path() / "a.txt";
  write_text(path, "# head\r\n1 -2.5e-3\t+3\r\n\r\n  4 , 5\n");
  const auto rows = read_number_rows(path, ' ');
  REQUIRE(rows.size() == 2);
  CHECK(rows[0].line == 2);
  CHECK(rows[0].values == std::vector<double>{1, -2.5e-3, 3});
  CHECK(rows[1].line == 4);
  CHECK(rows[1].values == std::vector<double>{4, 5});
}

TEST_CASE("what is no finite number is refused with its line") {
  const TempFolder folder;
  const auto path = folder.path() / "a.txt";
  for (const char* const bad : {"nan", "inf", "-INF", "1e999", "1.5x", "abc", "--1", "+-1", "1e"}) {
    write_text(path, std::string("1\n2\n") + bad + "\n");
    const std::string line = complaint([&] { read_number_rows(path, ' '); });
    INFO(bad);
    CHECK(line.find(path.string() + ":3: ") == 0);
  }
  write_text(path, std::string("1\n\0\x1b[2J\n", 7));
  CHECK(complaint([&] { read_number_rows(path, ' '); }).find(":2: \"??[2J\" is not a number") !=
        std::string::npos);
  write_text(path, "1,,2\n");
  CHECK(complaint([&] { read_number_rows(path, ','); }).find(":1: ") != std::string::npos);
}

// Found by fuzzing: as nanoseconds such times did not fit into 64 bits.
TEST_CASE("times of centuries are refused") {
  const TempFolder folder;
  const auto path = folder.path() / "times.txt";
  std::vector<std::string> warnings;
  for (const char* const text : {"#timestamp [ns]\n1403636579763555584\n14003636579813555456\n",
                                 "1\n1e10\n", "-1e10\n1\n", "0\n1e300\n"}) {
    write_text(path, text);
    CHECK(complaint([&] { read_times(path, warnings); }).ends_with("times of more than 292 years"));
  }
  write_text(path, "9000000000000000000\n9100000000000000000\n");
  CHECK(read_times(path, warnings)[1] == 9.1e9);
}

TEST_CASE("times ascend strictly, one per line") {
  const TempFolder folder;
  const auto path = folder.path() / "times.txt";
  std::vector<std::string> warnings;
  write_text(path, "0\n0.1\n0.25\n");
  CHECK(read_times(path, warnings) == std::vector<double>{0, 0.1, 0.25});
  write_text(path, "0\n0.1\n0.1\n");
  CHECK(complaint([&] {
          read_times(path, warnings);
        }).find(":3: times are not strictly ascending") != std::string::npos);
  write_text(path, "0\n0.2\n0.1\n");
  CHECK(complaint([&] { read_times(path, warnings); }).find(":3: ") != std::string::npos);
  write_text(path, "0\n0.2 7\n");
  CHECK(complaint([&] { read_times(path, warnings); }).find(":2: ") != std::string::npos);
  write_text(path, "# nothing\n");
  CHECK(complaint([&] { read_times(path, warnings); }).find("no times") != std::string::npos);
  CHECK(complaint([&] { read_times(folder.path(), warnings); }).find("cannot be read") !=
        std::string::npos);
  CHECK(warnings.empty());
  write_text(path, "1403636579000000000\n1403636579050000000\n");
  const std::vector<double> times = read_times(path, warnings);
  REQUIRE(times.size() == 2);
  CHECK(times[1] - times[0] == Approx(0.05).margin(1e-6));
  REQUIRE(warnings.size() == 1);
  INFO(warnings[0]);
  CHECK(warnings[0].find("read as nanoseconds: 140363657") != std::string::npos);
}

}  // namespace
}  // namespace hybrid_slam
