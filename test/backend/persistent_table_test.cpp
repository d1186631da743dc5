#include "backend/map/persistent_table.h"

#include <catch2/catch.hpp>
#include <map>
#include <random>
#include <string>
#include <vector>

namespace hybrid_slam {
namespace {

std::map<std::uint64_t, int> content(const PersistentTable<int>& table) {
  std::map<std::uint64_t, int> found;
  std::uint64_t previous = 0;
  table.for_each([&](std::uint64_t index, const int& value) {
    CHECK((found.empty() || index > previous));
    previous = index;
    found[index] = value;
  });
  return found;
}

TEST_CASE("A table finds what was inserted and nothing else") {
  PersistentTable<std::string> table;
  CHECK(table.find(0) == nullptr);
  CHECK(table.find(0xffffffff) == nullptr);
  for (const std::uint64_t index : {0u, 31u, 32u, 1023u, 1024u, 70000u}) {
    table.insert(index, std::to_string(index));
  }
  CHECK(table.size() == 6);
  for (const std::uint64_t index : {0u, 31u, 32u, 1023u, 1024u, 70000u}) {
    REQUIRE(table.find(index) != nullptr);
    CHECK(*table.find(index) == std::to_string(index));
  }
  for (const std::uint64_t index : {1u, 33u, 1025u, 69999u, 0xffffffffu}) {
    CHECK(table.find(index) == nullptr);
  }
}

TEST_CASE("A table says when it is used wrongly") {
  PersistentTable<int> table;
  CHECK_THROWS_AS(table.edit(0), std::out_of_range);
  table.insert(5, 1);
  CHECK_THROWS_AS(table.insert(5, 2), std::logic_error);
  CHECK_THROWS_AS(table.edit(6), std::out_of_range);
  CHECK(*table.find(5) == 1);
  CHECK_FALSE(table.erase(6));
  CHECK(table.erase(5));
  CHECK_FALSE(table.erase(5));
  CHECK(table.size() == 0);
  table.insert(7, 3);
  CHECK(content(table) == std::map<std::uint64_t, int>{{7, 3}});
}

TEST_CASE("Shared tables go on independently, each as its own std::map") {
  struct Version {
    PersistentTable<int> table;
    std::map<std::uint64_t, int> model;
  };
  std::mt19937_64 random(1);
  std::vector<Version> versions(1);
  for (int step = 0; step < 20000; ++step) {
    Version& v = versions[random() % versions.size()];
    const std::uint64_t index = random() % 3000;
    switch (random() % 4) {
      case 0:
      case 1:
        if (v.model.contains(index)) {
          v.table.edit(index) = step;
        } else {
          v.table.insert(index, step);
        }
        v.model[index] = step;
        break;
      case 2:
        CHECK(v.table.erase(index) == (v.model.erase(index) == 1));
        break;
      default:
        if (random() % 100 == 0 && versions.size() < 12) {
          Version copy{v.table.share(), v.model};
          versions.push_back(std::move(copy));
        }
    }
  }
  REQUIRE(versions.size() == 12);
  for (const Version& v : versions) {
    CHECK(content(v.table) == v.model);
    CHECK(v.table.size() == v.model.size());
  }
}

std::vector<std::uint64_t> changes(const PersistentTable<int>& a, const PersistentTable<int>& b) {
  std::vector<std::uint64_t> found;
  a.for_each_change(b, [&](std::uint64_t index) { found.push_back(index); });
  return found;
}

TEST_CASE("Two tables name what was edited since one was shared from the other, and no more") {
  using Indices = std::vector<std::uint64_t>;
  PersistentTable<int> table;
  for (int i = 0; i < 900; ++i) table.insert(static_cast<std::uint64_t>(i), i);
  const auto before = table.share();
  CHECK(changes(table, before).empty());
  table.edit(31) = -1;
  table.edit(32) = -1;
  table.erase(700);
  table.insert(900, 0);
  CHECK(changes(table, before) == Indices{31, 32, 700, 900});
  CHECK(changes(before, table) == Indices{31, 32, 700, 900});
  table.insert(40000, 0);  // the table grows by a level
  CHECK(changes(table, before) == Indices{31, 32, 700, 900, 40000});
  CHECK(changes(before, table) == Indices{31, 32, 700, 900, 40000});
  const PersistentTable<int> none;
  CHECK(changes(before, none).size() == 900);
  CHECK(changes(none, before).size() == 900);
}

struct Counted {
  static inline int copies = 0;
  Counted() = default;
  Counted(const Counted&) { ++copies; }
  Counted(Counted&&) noexcept = default;
  Counted& operator=(const Counted&) = delete;
  Counted& operator=(Counted&&) = delete;
  ~Counted() = default;
};

TEST_CASE("An edit copies its own value once after a share, and no neighbour") {
  PersistentTable<Counted> table;
  for (std::uint64_t i = 0; i < 5000; ++i) table.insert(i, {});
  Counted::copies = 0;
  table.edit(1000);
  CHECK(Counted::copies == 0);
  const auto snapshot = table.share();
  CHECK(Counted::copies == 0);
  table.edit(1000);
  table.edit(1000);
  CHECK(Counted::copies == 1);
  CHECK(snapshot.find(1000) != table.find(1000));
  CHECK(snapshot.find(1001) == table.find(1001));
}

TEST_CASE("A dropped share frees its values") {
  auto value = std::make_shared<int>(1);
  PersistentTable<std::shared_ptr<int>> table;
  table.insert(40, value);
  {
    const auto snapshot = table.share();
    table.erase(40);
    CHECK(value.use_count() == 2);
  }
  CHECK(value.use_count() == 1);
}

}  // namespace
}  // namespace hybrid_slam
