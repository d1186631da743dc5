#include <algorithm>
#include <set>
#include <vector>

#include "backend/incremental/elimination_order.h"
#include "test/support/random.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

using Adjacency = std::vector<std::vector<std::uint32_t>>;
using Cliques = std::vector<EliminationClique>;

Adjacency graph_of(std::size_t count,
                   const std::vector<std::pair<std::uint32_t, std::uint32_t>>& edges) {
  std::vector<std::set<std::uint32_t>> neighbours(count);
  for (const auto& [a, b] : edges) {
    neighbours[a].insert(b);
    neighbours[b].insert(a);
  }
  Adjacency result;
  for (const auto& of_one : neighbours) result.emplace_back(of_one.begin(), of_one.end());
  return result;
}

Adjacency random_graph(std::uint32_t count, std::size_t edges, Random& random) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
  while (pairs.size() < edges && count > 1) {
    const auto a = static_cast<std::uint32_t>(random.below(count));
    const auto b = static_cast<std::uint32_t>(random.below(count));
    if (a != b) pairs.emplace_back(a, b);
  }
  return graph_of(count, pairs);
}

std::set<std::uint32_t> members(const EliminationClique& clique) {
  std::set<std::uint32_t> result(clique.frontals.begin(), clique.frontals.end());
  result.insert(clique.separator.begin(), clique.separator.end());
  return result;
}

// By vertex: the clique that eliminates it. Fails unless there is exactly one.
std::vector<std::size_t> home_of(const Cliques& cliques, std::size_t count) {
  std::vector<std::size_t> home(count, cliques.size());
  for (std::size_t i = 0; i < cliques.size(); ++i) {
    REQUIRE_FALSE(cliques[i].frontals.empty());
    for (const std::uint32_t v : cliques[i].frontals) {
      REQUIRE(v < count);
      REQUIRE(home[v] == cliques.size());
      home[v] = i;
    }
  }
  REQUIRE(std::find(home.begin(), home.end(), cliques.size()) == home.end());
  return home;
}

// A clique's separator is eliminated above, and whole in what its parent joins.
void check_tree(const Cliques& cliques) {
  for (std::size_t i = 0; i < cliques.size(); ++i) {
    const EliminationClique& clique = cliques[i];
    REQUIRE(clique.parent < static_cast<std::int32_t>(i));
    REQUIRE(clique.separator.empty() == (clique.parent < 0));
    if (clique.parent < 0) continue;
    const auto above = members(cliques[static_cast<std::size_t>(clique.parent)]);
    for (const std::uint32_t v : clique.separator) {
      REQUIRE(above.count(v) == 1);
      REQUIRE(std::count(clique.frontals.begin(), clique.frontals.end(), v) == 0);
    }
  }
}

// Every edge lies in the clique that eliminates its first end, the deeper one.
void check_edges(const Cliques& cliques, const std::vector<std::size_t>& home,
                 const Adjacency& graph) {
  for (std::uint32_t a = 0; a < graph.size(); ++a) {
    for (const std::uint32_t b : graph[a]) {
      const std::uint32_t first = home[a] > home[b] ? a : b;
      const std::uint32_t second = first == a ? b : a;
      REQUIRE(members(cliques[home[first]]).count(second) == 1);
    }
  }
}

void check_elimination(const Cliques& cliques, const Adjacency& graph) {
  check_tree(cliques);
  check_edges(cliques, home_of(cliques, graph.size()), graph);
}

// Position in an elimination that goes through the cliques from the last to the first.
std::vector<std::size_t> positions(const Cliques& cliques, std::size_t count) {
  std::vector<std::size_t> result(count);
  std::size_t next = 0;
  for (auto clique = cliques.rbegin(); clique != cliques.rend(); ++clique) {
    for (const std::uint32_t v : clique->frontals) result[v] = next++;
  }
  return result;
}

std::size_t blocks(const Cliques& cliques) {  // of the factor
  std::size_t count = 0;
  for (const EliminationClique& clique : cliques) {
    const std::size_t f = clique.frontals.size();
    count += f * (f + 1) / 2 + f * clique.separator.size();
  }
  return count;
}

TEST_CASE("elimination order: random graphs are eliminated validly") {
  Random random(1);
  for (int trial = 0; trial < 300; ++trial) {
    const auto count = static_cast<std::uint32_t>(random.integer(0, 40));
    const Adjacency graph =
        random_graph(count, static_cast<std::size_t>(random.integer(0, 3)) * count, random);
    const std::vector<char> last(count, 0);
    const auto padding = static_cast<std::size_t>(random.integer(0, 3));
    check_elimination(eliminate(graph, last, padding), graph);
  }
}

TEST_CASE("elimination order: without padding the cliques hold what elimination fills, no more") {
  Random random(2);
  for (int trial = 0; trial < 100; ++trial) {
    const auto count = static_cast<std::uint32_t>(random.integer(2, 30));
    const Adjacency graph = random_graph(count, 2 * count, random);
    const Cliques cliques = eliminate(graph, std::vector<char>(count, 0), 0);
    const std::vector<std::size_t> position = positions(cliques, count);
    // The textbook: eliminating a vertex joins all its later neighbours.
    std::vector<std::set<std::uint32_t>> left(count);
    for (std::uint32_t v = 0; v < count; ++v) left[v] = {graph[v].begin(), graph[v].end()};
    std::vector<std::uint32_t> order(count);
    for (std::uint32_t v = 0; v < count; ++v) order[position[v]] = v;
    std::size_t filled = 0;
    for (const std::uint32_t v : order) {
      filled += 1 + left[v].size();
      for (const std::uint32_t a : left[v]) {
        left[a].erase(v);
        for (const std::uint32_t b : left[v]) {
          if (a != b) left[a].insert(b);
        }
      }
    }
    CHECK(blocks(cliques) == filled);
  }
}

TEST_CASE("elimination order: a chain makes small cliques, a star is eliminated from its rays") {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> chain;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> star;
  constexpr std::uint32_t kCount = 100;
  for (std::uint32_t v = 1; v < kCount; ++v) {
    chain.emplace_back(v - 1, v);
    star.emplace_back(0, v);
  }
  const std::vector<char> last(kCount, 0);
  CHECK(blocks(eliminate(graph_of(kCount, chain), last, 0)) == 2 * kCount - 1);
  // In time the hub comes first and fills all: minimum degree must win.
  CHECK(blocks(eliminate(graph_of(kCount, star), last, 0)) == 2 * kCount - 1);
}

TEST_CASE("elimination order: what is wanted last comes last") {
  Random random(3);
  for (int trial = 0; trial < 100; ++trial) {
    const auto count = static_cast<std::uint32_t>(random.integer(2, 40));
    const Adjacency graph = random_graph(count, 2 * count, random);
    std::vector<char> last(count, 0);
    for (char& flag : last) flag = random.uniform() < 0.2 ? 1 : 0;
    const Cliques cliques = eliminate(graph, last, 0);
    check_elimination(cliques, graph);
    // Whatever is eliminated after one of them on the way to the root is one of them.
    for (const EliminationClique& clique : cliques) {
      const auto first_last = std::find_if(clique.frontals.begin(), clique.frontals.end(),
                                           [&](std::uint32_t v) { return last[v] != 0; });
      if (first_last == clique.frontals.end()) continue;
      CHECK(std::all_of(first_last, clique.frontals.end(),
                        [&](std::uint32_t v) { return last[v] != 0; }));
      CHECK(std::all_of(clique.separator.begin(), clique.separator.end(),
                        [&](std::uint32_t v) { return last[v] != 0; }));
    }
  }
}

}  // namespace
}  // namespace hybrid_slam
