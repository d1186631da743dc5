#pragma once

#include <cstddef>

#include "frontend/features/cuda/parallel.h"
#include "frontend/matching/descriptor_distance.h"

// All pairs of two sets of descriptors, in integers: |a - b|^2 = |a|^2 + |b|^2 - 2 a.b, four bytes
// of a product at a time. Tiles of the table of distances are made side by side, each with the
// nearest of its rows and columns; these are then merged in a fixed order. Equal distances go to
// the lower index, in both directions.

namespace hybrid_slam::cuda {

constexpr int kWords = 128 / 4;  // of a descriptor
constexpr int kTile = 64;        // descriptors along a side

// a.b of four bytes each, and a number.
HS_HOST_DEVICE inline unsigned add_products(unsigned a, unsigned b, unsigned sum) {
#ifdef __CUDA_ARCH__
  return __dp4a(a, b, sum);
#else
  for (int shift = 0; shift < 32; shift += 8) sum += (a >> shift & 255U) * (b >> shift & 255U);
  return sum;
#endif
}

struct DescriptorsView {
  const unsigned* words;  // kWords each
  int count;

  HS_HOST_DEVICE int tiles() const { return (count + kTile - 1) / kTile; }
};

// The nearest of some descriptors.
struct Nearest {
  int distance;  // squared
  int second;    // squared, of the second nearest
  int index;

  HS_HOST_DEVICE static Nearest none() { return {kNone, kNone, -1}; }
  HS_HOST_DEVICE bool has_second() const { return second != kNone; }

  // Another one, of a higher index.
  HS_HOST_DEVICE void add(int its_distance, int its_index) {
    if (its_distance < distance) {
      second = distance;
      distance = its_distance;
      index = its_index;
    } else if (its_distance < second) {
      second = its_distance;
    }
  }
  // The nearest of others, all of higher indices.
  HS_HOST_DEVICE void add(const Nearest& other) {
    add(other.distance, other.index);
    if (other.second < second) second = other.second;
  }

 private:
  static constexpr int kNone = 0x7FFFFFFF;
};

// Grid: tiles of train, tiles of query descriptors.
struct NearestOfTiles {
  static constexpr int kThreads = 128;
  static constexpr int kQueries = 8;  // of a thread
  static constexpr int kTrains = 4;
  static constexpr int kAcross = kTile / kTrains;
  static constexpr int kRowStep = kWords + 1;  // rows start in different banks of shared memory

  struct Shared {
    unsigned query[kTile][kRowStep];
    unsigned train[kTile][kRowStep];
    int query_length[kTile];  // squared
    int train_length[kTile];
    int products[kTile][kTile + 1];
  };

  DescriptorsView query;
  DescriptorsView train;
  Nearest* of_queries;  // [tile of train][query]
  Nearest* of_trains;   // [tile of query][train]

  HS_HOST_DEVICE void operator()(const Block& block, Shared& shared) const {
    const int first_query = block.y * kTile;
    const int first_train = block.x * kTile;
    const int queries = query.count - first_query < kTile ? query.count - first_query : kTile;
    const int trains = train.count - first_train < kTile ? train.count - first_train : kTile;
    block.each(kTile * kWords, [&](int i) {
      const int row = i / kWords;
      shared.query[row][i % kWords] = row < queries ? word(query, first_query + row, i) : 0;
      shared.train[row][i % kWords] = row < trains ? word(train, first_train + row, i) : 0;
    });
    block.each(2 * kTile, [&](int i) {
      const unsigned* words = i < kTile ? shared.query[i] : shared.train[i - kTile];
      unsigned sum = 0;
      for (int k = 0; k < kWords; ++k) sum = add_products(words[k], words[k], sum);
      (i < kTile ? shared.query_length : shared.train_length)[i % kTile] = static_cast<int>(sum);
    });
    block.each(kThreads, [&](int i) { multiply(i / kAcross * kQueries, i % kAcross, shared); });
    block.each(2 * kTile, [&](int i) {
      const int at = i % kTile;
      const bool row = i < kTile;
      if (at >= (row ? queries : trains)) return;
      Nearest nearest = Nearest::none();
      const int length = row ? shared.query_length[at] : shared.train_length[at];
      for (int k = 0; k < (row ? trains : queries); ++k) {
        const int product = row ? shared.products[at][k] : shared.products[k][at];
        const int other = row ? shared.train_length[k] : shared.query_length[k];
        nearest.add(length + other - 2 * product, (row ? first_train : first_query) + k);
      }
      if (row) {
        of_queries[static_cast<std::size_t>(block.x) * query.count + first_query + at] = nearest;
      } else {
        of_trains[static_cast<std::size_t>(block.y) * train.count + first_train + at] = nearest;
      }
    });
  }

 private:
  HS_HOST_DEVICE static unsigned word(const DescriptorsView& set, int descriptor, int i) {
    return set.words[static_cast<std::size_t>(descriptor) * kWords + i % kWords];
  }

  // kQueries rows from `row`, every kAcross-th column from `column`.
  HS_HOST_DEVICE static void multiply(int row, int column, Shared& shared) {
    unsigned sums[kQueries][kTrains] = {};
    for (int k = 0; k < kWords; ++k) {
      unsigned of_train[kTrains];
      HS_UNROLL
      for (int t = 0; t < kTrains; ++t) of_train[t] = shared.train[column + t * kAcross][k];
      HS_UNROLL
      for (int q = 0; q < kQueries; ++q) {
        const unsigned of_query = shared.query[row + q][k];
        HS_UNROLL
        for (int t = 0; t < kTrains; ++t) {
          sums[q][t] = add_products(of_query, of_train[t], sums[q][t]);
        }
      }
    }
    HS_UNROLL
    for (int q = 0; q < kQueries; ++q) {
      HS_UNROLL
      for (int t = 0; t < kTrains; ++t) {
        shared.products[row + q][column + t * kAcross] = static_cast<int>(sums[q][t]);
      }
    }
  }
};

// Any number of blocks. Merges the tiles of all queries, then of all train descriptors.
struct MergeTiles {
  static constexpr int kThreads = 128;
  using Shared = NothingShared;

  int query_count;
  int train_count;
  const Nearest* tiles_of_queries;
  const Nearest* tiles_of_trains;
  Nearest* of_queries;
  Nearest* of_trains;

  HS_HOST_DEVICE void operator()(const Block& block, Shared&) const {
    block.each_of_grid(query_count + train_count, [&](int i) {
      if (i < query_count) {
        of_queries[i] = merged(tiles_of_queries, query_count, train_count, i);
      } else {
        const int train = i - query_count;
        of_trains[train] = merged(tiles_of_trains, train_count, query_count, train);
      }
    });
  }

 private:
  HS_HOST_DEVICE static Nearest merged(const Nearest* tiles, int count, int others, int i) {
    Nearest nearest = Nearest::none();
    for (int tile = 0; tile * kTile < others; ++tile) {
      nearest.add(tiles[static_cast<std::size_t>(tile) * count + i]);
    }
    return nearest;
  }
};

struct MatchTests {
  int max_squared_distance;
  double ratio;  // see BruteForceOptions
  bool mutual;
};

// The nearest of both directions between two sets.
struct Neighbours {
  const Nearest* of_queries;
  const Nearest* of_trains;

  // The match of a query, -1 if there is none.
  HS_HOST_DEVICE int match(int query, const MatchTests& tests) const {
    const Nearest& nearest = of_queries[query];
    if (nearest.index < 0 || nearest.distance > tests.max_squared_distance) return -1;
    const int second = nearest.has_second() ? nearest.second : -1;
    if (tests.ratio < 1 && !passes_ratio(nearest.distance, second, tests.ratio)) return -1;
    if (tests.mutual && of_trains[nearest.index].index != query) return -1;
    return nearest.index;
  }
};

struct Match {
  int train;  // -1: none
  int squared_distance;
};

// Any number of blocks.
struct WriteMatches {
  static constexpr int kThreads = 128;
  using Shared = NothingShared;

  Neighbours neighbours;
  MatchTests tests;
  int count;  // of queries
  Match* matches;

  HS_HOST_DEVICE void operator()(const Block& block, Shared&) const {
    block.each_of_grid(count, [&](int i) {
      matches[i] = {neighbours.match(i, tests), neighbours.of_queries[i].distance};
    });
  }
};

// Any number of blocks. Copies chosen descriptors.
struct GatherDescriptors {
  static constexpr int kThreads = 256;
  using Shared = NothingShared;

  const unsigned* from;
  const int* chosen;
  int count;
  unsigned* to;

  HS_HOST_DEVICE void operator()(const Block& block, Shared&) const {
    block.each_of_grid(count * kWords, [&](int i) {
      to[i] = from[static_cast<std::size_t>(chosen[i / kWords]) * kWords + i % kWords];
    });
  }
};

// Any number of blocks. Of two sets of pairs, the left and the right descriptors' matches: those
// that join the same two pairs.
struct CloseCircles {
  static constexpr int kThreads = 128;
  using Shared = NothingShared;

  Neighbours left;
  Neighbours right;
  MatchTests tests;
  int count;     // of the first set's pairs
  int* partner;  // of each in the second set, -1: none

  HS_HOST_DEVICE void operator()(const Block& block, Shared&) const {
    block.each_of_grid(count, [&](int i) {
      const int of_left = left.match(i, tests);
      partner[i] = of_left >= 0 && right.match(i, tests) == of_left ? of_left : -1;
    });
  }
};

}  // namespace hybrid_slam::cuda
