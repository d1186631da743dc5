#include "test/backend/incremental/corridor.h"

#include <cstdio>

#include "backend/problem/solve_graph.h"
#include "test/backend/incremental/graph_feed.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

TEST_CASE("corridor: what an update costs does not grow with the map") {
  struct Mean {
    double multiplications = 0;
    double poses = 0;
    double count = 0;
    void add(const UpdateSummary& summary) {
      multiplications += summary.multiplications;
      poses += static_cast<double>(summary.poses);
      ++count;
    }
  };
  GraphFeed feed(corridor_graph(2001, 3), {});
  Mean early;
  Mean late;
  for (int update = 0; !feed.done(); ++update) {
    const UpdateSummary summary = feed.feed_next();
    static Mean all; all.add(summary); if (update % 50 == 49) { std::printf("%d: mult %.3g poses %.1f relin %zu pending %zu moved %zu steps %d\n", update, all.multiplications/all.count, all.poses/all.count, summary.relinearized, summary.pending, summary.moved, summary.steps); std::fflush(stdout); all = {}; }
    if (update >= 150 && update < 250) early.add(summary);
    if (update >= 1900 && update < 2000) late.add(summary);
  }
  REQUIRE(early.count == late.count);
  std::printf("multiplications %.3g then %.3g, poses %.1f then %.1f\n",
              early.multiplications / early.count, late.multiplications / late.count,
              early.poses / early.count, late.poses / late.count);
  CHECK(late.multiplications < 1.2 * early.multiplications);
  CHECK(late.poses < 1.2 * early.poses);
  CHECK(excess(feed.solver()) < 0.01);
}

}  // namespace
}  // namespace hybrid_slam
