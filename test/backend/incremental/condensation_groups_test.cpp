// Which landmarks are condensed together.
#include "backend/incremental/condensation_groups.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "backend/incremental/condensed_term.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

constexpr double kNoLimit = 1e12;

// So many landmarks begin with each pose and are seen by so many in a row, all in one clique.
std::vector<CondensableLandmark> row_of(std::uint32_t poses, std::uint32_t each,
                                        std::uint32_t seen_by) {
  std::vector<CondensableLandmark> landmarks;
  for (std::uint32_t first = 0; first < poses; ++first) {
    for (std::uint32_t i = 0; i < each; ++i) {
      CondensableLandmark landmark;
      landmark.point = static_cast<std::uint32_t>(landmarks.size());
      landmark.poses.resize(seen_by);
      std::iota(landmark.poses.begin(), landmark.poses.end(), first);
      landmarks.push_back(landmark);
    }
  }
  return landmarks;
}

std::size_t bytes_of(const std::vector<CondensedGroup>& groups, std::size_t seen_by) {
  std::size_t bytes = 0;
  for (const CondensedGroup& group : groups) {
    bytes += CondensedTerm::bytes(group.poses.size(), group.points.size() * seen_by);
  }
  return bytes;
}

TEST_CASE("condensed groups: each landmark is in one, with the poses that see it") {
  const std::vector<CondensableLandmark> landmarks = row_of(40, 3, 5);
  std::vector<int> met(landmarks.size(), 0);
  for (const CondensedGroup& group : condensed_groups(landmarks, {}, kNoLimit)) {
    for (const std::uint32_t point : group.points) {
      ++met[point];
      const std::vector<std::uint32_t>& poses = landmarks[point].poses;
      CHECK(std::includes(group.poses.begin(), group.poses.end(), poses.begin(), poses.end()));
    }
  }
  CHECK(std::count(met.begin(), met.end(), 1) == std::ssize(met));
}

TEST_CASE("condensed groups: they take less memory than what begins alike does alone") {
  for (const std::uint32_t each : {3U, 30U}) {
    for (const std::uint32_t seen_by : {4U, 12U, 40U}) {
      CAPTURE(each, seen_by);
      const auto groups = condensed_groups(row_of(100, each, seen_by), {}, kNoLimit);
      const std::size_t alone = 100 * CondensedTerm::bytes(seen_by, each * seen_by);
      CHECK(groups.size() < 50);
      CHECK(100 * bytes_of(groups, seen_by) < 65 * alone);
    }
  }
}

TEST_CASE("condensed groups: cliques are not mixed") {
  std::vector<CondensableLandmark> landmarks = row_of(10, 4, 4);
  for (CondensableLandmark& landmark : landmarks) landmark.clique = landmark.point % 2 == 0 ? 5 : 3;
  for (const CondensedGroup& group : condensed_groups(landmarks, {}, kNoLimit)) {
    for (const std::uint32_t point : group.points) {
      CHECK(landmarks[point].clique == landmarks[group.points.front()].clique);
    }
  }
}

TEST_CASE("condensed groups: what comes later joins what its clique has") {
  const std::vector<CondensableLandmark> landmarks = row_of(4, 20, 25);
  KnownGroup known{0, 7, landmarks.front().poses, std::vector<std::size_t>(20, 25)};
  const auto joined = condensed_groups(landmarks, {known}, kNoLimit);
  REQUIRE(joined.size() == 1);
  CHECK(joined.front().term == 7);
  CHECK(joined.front().poses.size() == 28);
  CHECK(joined.front().points.size() == landmarks.size());
  known.clique = 1;
  for (const CondensedGroup& group : condensed_groups(landmarks, {known}, kNoLimit)) {
    CHECK(group.term == CondensedGroup::kNew);
  }
}

TEST_CASE("condensed groups: none takes more work to be taken apart than is allowed") {
  constexpr std::size_t kEach = 50;
  constexpr std::size_t kSeenBy = 10;
  // Of 11,000 multiplications each, at least: the blocks between ten poses.
  const auto groups = condensed_groups(row_of(20, kEach, kSeenBy), {}, 1e5);
  for (const CondensedGroup& group : groups) CHECK(group.points.size() <= 17);
  // One that is more by itself is a group nevertheless.
  CHECK(condensed_groups(row_of(1, 2, 100), {}, 1e5).size() == 2);
}

}  // namespace
}  // namespace hybrid_slam
