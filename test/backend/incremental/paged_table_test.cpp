#include "backend/incremental/paged_table.h"

#include <map>
#include <random>
#include <vector>

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

TEST_CASE("A paged table is a map from index to value") {
  PagedTable<std::vector<int>> table;
  std::map<std::uint32_t, std::vector<int>> expected;
  std::mt19937 random(5);
  for (int i = 0; i < 20000; ++i) {
    // A window of indices that moves on, so that whole pages go.
    const auto index = static_cast<std::uint32_t>(static_cast<unsigned>(i) / 20 + random() % 150);
    if (random() % 2 == 0) {
      const auto [value, is_new] = table.try_emplace(index);
      REQUIRE(is_new == expected.try_emplace(index).second);
      REQUIRE(value == expected[index]);
      value.push_back(i);
      expected[index].push_back(i);
    } else {
      table.erase(index);
      expected.erase(index);
    }
  }
  for (std::uint32_t index = 0; index < 1400; ++index) {
    const std::vector<int>* const found = table.find(index);
    const auto wanted = expected.find(index);
    REQUIRE((found != nullptr) == (wanted != expected.end()));
    if (found != nullptr) CHECK(*found == wanted->second);
  }
  CHECK(table.find(static_cast<std::uint32_t>(-1)) == nullptr);
}

}  // namespace
}  // namespace hybrid_slam
