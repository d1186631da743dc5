#include "test/backend/incremental/corridor.h"

#include <algorithm>

#include "test/backend/incremental/graph_feed.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

struct Mean {
  double multiplications = 0;
  double moved = 0;
  double count = 0;

  void add(const UpdateSummary& summary) {
    multiplications += summary.multiplications;
    moved += static_cast<double>(summary.moved.size());
    ++count;
  }
};

TEST_CASE("corridor: what an update costs does not grow with the map") {
  GraphFeed feed(corridor_graph(2050, 10), {});
  Mean early;
  Mean late;
  std::size_t most_moved = 0;
  for (int update = 0; !feed.done(); ++update) {
    const UpdateSummary summary = feed.feed_next();
    most_moved = std::max(most_moved, summary.moved.size());
    if (update >= 150 && update < 250) early.add(summary);
    if (update >= 1950) late.add(summary);
  }
  REQUIRE(early.count == late.count);
  CHECK(late.multiplications < 1.2 * early.multiplications);
  CHECK(late.moved < 1.2 * early.moved);
  CHECK(most_moved < 100);  // what has been left behind stays where it is
  CHECK(excess(feed.solver()) < 0.01);
}

}  // namespace
}  // namespace hybrid_slam
