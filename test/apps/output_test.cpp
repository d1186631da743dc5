#include "apps/io/ply.h"

#include <cstring>

#include <catch2/catch.hpp>

#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

TEST_CASE("a PLY file has a header and fifteen bytes per point") {
  const TempFolder folder;
  const std::vector<ColoredPoint> points{{{1, -2, 3.5}, {10, 20, 30}}, {{4, 5, 6}, {255, 0, 7}}};
  write_ply(folder.path() / "a.ply", points);
  const std::string text = read_text(folder.path() / "a.ply");
  const std::size_t header = text.find("end_header\n") + 11;
  CHECK(text.starts_with("ply\nformat binary_little_endian 1.0\nelement vertex 2\n"));
  REQUIRE(text.size() == header + 30);
  float xyz[3];
  std::memcpy(xyz, text.data() + header, sizeof(xyz));
  CHECK(xyz[0] == 1);
  CHECK(xyz[1] == -2);
  CHECK(xyz[2] == 3.5F);
  CHECK(static_cast<unsigned char>(text[header + 14]) == 30);
  CHECK(static_cast<unsigned char>(text[header + 15 + 12]) == 255);
}

}  // namespace
}  // namespace hybrid_slam
