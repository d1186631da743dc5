#include "frontend/matching/brute_force.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "frontend/matching/descriptor_distance.h"

// Compiled once per instruction set; the best one that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frontend/matching/brute_force.cpp"
#include <hwy/aligned_allocator.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// |a - b|^2 = |a|^2 + |b|^2 - 2 a.b in integers. Train descriptors are interleaved, so that one
// vector holds the same two dimensions of as many descriptors as it has 32-bit lanes: a pairwise
// multiply-add with the query's two dimensions in every lane then sums up the products without ever
// adding across lanes.
HWY_BEFORE_NAMESPACE();
namespace hybrid_slam {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kDims = 128;
constexpr std::size_t kPairs = kDims / 2;
constexpr std::size_t kQueryBlock = 4;
constexpr std::size_t kTileVectors = 8;  // train vectors that stay in the first-level cache
static_assert(kTileVectors % 2 == 0);
constexpr std::int32_t kFar = std::numeric_limits<std::int32_t>::max();

using D32 = hn::ScalableTag<std::int32_t>;

std::int32_t squared_length(const Descriptor& descriptor) {
  std::int32_t sum = 0;
  for (const std::uint8_t byte : descriptor) sum += byte * byte;
  return sum;
}

// What the kernel reads and writes; arrays padded to pairs of vectors and whole query blocks.
// Padding has a squared length of kFar / 2 and therefore never wins against a descriptor.
struct Workspace {
  std::size_t lanes;
  std::size_t train_vectors;
  std::size_t query_blocks;
  hwy::AlignedFreeUniquePtr<std::int16_t[]> train;  // [vector][pair][lane][2]
  hwy::AlignedFreeUniquePtr<std::int16_t[]> query;  // [query][dimension]
  hwy::AlignedFreeUniquePtr<std::int32_t[]> train_length;
  hwy::AlignedFreeUniquePtr<std::int32_t[]> query_length;
  // Per query and lane: the best, second best and the best's index.
  hwy::AlignedFreeUniquePtr<std::int32_t[]> best;
  hwy::AlignedFreeUniquePtr<std::int32_t[]> second;
  hwy::AlignedFreeUniquePtr<std::int32_t[]> index;
  // Per train descriptor: the best query.
  hwy::AlignedFreeUniquePtr<std::int32_t[]> train_best;
  hwy::AlignedFreeUniquePtr<std::int32_t[]> train_index;
};

hwy::AlignedFreeUniquePtr<std::int32_t[]> filled(std::size_t count, std::int32_t value) {
  auto array = hwy::AllocateAligned<std::int32_t>(count);
  std::fill_n(array.get(), count, value);
  return array;
}

Workspace prepare(std::span<const Descriptor> query, std::span<const Descriptor> train) {
  Workspace w;
  w.lanes = hn::Lanes(D32());
  w.train_vectors = (train.size() + 2 * w.lanes - 1) / (2 * w.lanes) * 2;
  w.query_blocks = (query.size() + kQueryBlock - 1) / kQueryBlock;
  const std::size_t padded_train = w.train_vectors * w.lanes;
  const std::size_t padded_query = w.query_blocks * kQueryBlock;
  w.train = hwy::AllocateAligned<std::int16_t>(padded_train * kDims);
  w.query = hwy::AllocateAligned<std::int16_t>(padded_query * kDims);
  std::fill_n(w.train.get(), padded_train * kDims, std::int16_t{0});
  std::fill_n(w.query.get(), padded_query * kDims, std::int16_t{0});
  w.train_length = filled(padded_train, kFar / 2);
  w.query_length = filled(padded_query, kFar / 2);
  for (std::size_t j = 0; j < train.size(); ++j) {
    std::int16_t* vector = w.train.get() + j / w.lanes * w.lanes * kDims + j % w.lanes * 2;
    for (std::size_t k = 0; k < kDims; ++k) vector[k / 2 * w.lanes * 2 + k % 2] = train[j][k];
    w.train_length[j] = squared_length(train[j]);
  }
  for (std::size_t i = 0; i < query.size(); ++i) {
    std::copy(query[i].begin(), query[i].end(), w.query.get() + i * kDims);
    w.query_length[i] = squared_length(query[i]);
  }
  w.best = filled(padded_query * w.lanes, kFar);
  w.second = filled(padded_query * w.lanes, kFar);
  w.index = filled(padded_query * w.lanes, -1);
  w.train_best = filled(padded_train, kFar);
  w.train_index = filled(padded_train, -1);
  return w;
}

template <class V>
struct Products {
  V q0, q1, q2, q3;
};

template <class V>
struct ProductPair {
  Products<V> left, right;
};

// Scalar products of four queries (rows of kDims) with the descriptors of two train vectors: with
// two, each number of a query that is loaded serves twice.
#if HWY_TARGET == HWY_SCALAR
// Its vectors have one lane of any width and cannot be reinterpreted: the baseline target.
template <class D, class V = hn::Vec<D>>
Products<V> multiply_one(D d32, const std::int16_t* query, const std::int16_t* train) {
  std::int32_t sum[kQueryBlock] = {};
  for (std::size_t k = 0; k < kDims; ++k) {
    for (std::size_t row = 0; row < kQueryBlock; ++row)
      sum[row] += query[row * kDims + k] * train[k];
  }
  return {hn::Set(d32, sum[0]), hn::Set(d32, sum[1]), hn::Set(d32, sum[2]), hn::Set(d32, sum[3])};
}

template <class D, class V = hn::Vec<D>>
ProductPair<V> multiply(D d32, const std::int16_t* query, const std::int16_t* train) {
  return {multiply_one(d32, query, train), multiply_one(d32, query, train + kDims)};
}
#else
template <class D, class V = hn::Vec<D>>
HWY_INLINE ProductPair<V> multiply(D d32, const std::int16_t* HWY_RESTRICT query,
                                   const std::int16_t* HWY_RESTRICT train) {
  const hn::Repartition<std::int16_t, D> d16;
  const V zero = hn::Zero(d32);
  Products<V> a{zero, zero, zero, zero}, c = a;  // sums of the first, and where the machine
  Products<V> b = a, e = a;                      // needs it, the second of each pair
  const std::size_t stride = 2 * hn::Lanes(d32);
  const auto two_dims = [&](std::size_t row, std::size_t pair) HWY_ATTR {
    std::int32_t both;
    hwy::CopyBytes<4>(query + row * kDims + 2 * pair, &both);
    return hn::BitCast(d16, hn::Set(d32, both));
  };
  for (std::size_t p = 0; p < kPairs; ++p) {
    const auto left = hn::Load(d16, train + p * stride);
    const auto right = hn::Load(d16, train + (kPairs + p) * stride);
    const auto q0 = two_dims(0, p);
    a.q0 = hn::ReorderWidenMulAccumulate(d32, q0, left, a.q0, b.q0);
    c.q0 = hn::ReorderWidenMulAccumulate(d32, q0, right, c.q0, e.q0);
    const auto q1 = two_dims(1, p);
    a.q1 = hn::ReorderWidenMulAccumulate(d32, q1, left, a.q1, b.q1);
    c.q1 = hn::ReorderWidenMulAccumulate(d32, q1, right, c.q1, e.q1);
    const auto q2 = two_dims(2, p);
    a.q2 = hn::ReorderWidenMulAccumulate(d32, q2, left, a.q2, b.q2);
    c.q2 = hn::ReorderWidenMulAccumulate(d32, q2, right, c.q2, e.q2);
    const auto q3 = two_dims(3, p);
    a.q3 = hn::ReorderWidenMulAccumulate(d32, q3, left, a.q3, b.q3);
    c.q3 = hn::ReorderWidenMulAccumulate(d32, q3, right, c.q3, e.q3);
  }
  const auto sums = [](const Products<V>& odd, const Products<V>& even) HWY_ATTR {
    return Products<V>{
        hn::RearrangeToOddPlusEven(odd.q0, even.q0), hn::RearrangeToOddPlusEven(odd.q1, even.q1),
        hn::RearrangeToOddPlusEven(odd.q2, even.q2), hn::RearrangeToOddPlusEven(odd.q3, even.q3)};
  };
  return {sums(a, b), sums(c, e)};
}
#endif

// Enters the distances between one query and one train vector into the bests of both.
template <class D, class V>
HWY_INLINE void enter(D d32, Workspace& w, std::size_t query, std::size_t vector, V product) {
  const std::size_t q = query * w.lanes;
  const std::size_t t = vector * w.lanes;
  const V length =
      hn::Add(hn::Load(d32, w.train_length.get() + t), hn::Set(d32, w.query_length[query]));
  const V distance = hn::Sub(length, hn::ShiftLeft<1>(product));

  const V best = hn::Load(d32, w.best.get() + q);
  const auto better = hn::Lt(distance, best);
  const V second = hn::Load(d32, w.second.get() + q);
  const V index = hn::Load(d32, w.index.get() + q);
  const V here = hn::Iota(d32, static_cast<std::int32_t>(t));
  hn::Store(hn::Min(second, hn::Max(distance, best)), d32, w.second.get() + q);
  hn::Store(hn::Min(distance, best), d32, w.best.get() + q);
  hn::Store(hn::IfThenElse(better, here, index), d32, w.index.get() + q);

  const V train_best = hn::Load(d32, w.train_best.get() + t);
  const V train_index = hn::Load(d32, w.train_index.get() + t);
  const auto closer = hn::Lt(distance, train_best);
  const V this_query = hn::Set(d32, static_cast<std::int32_t>(query));
  hn::Store(hn::Min(distance, train_best), d32, w.train_best.get() + t);
  hn::Store(hn::IfThenElse(closer, this_query, train_index), d32, w.train_index.get() + t);
}

template <class D, class V>
HWY_INLINE void enter_all(D d32, Workspace& w, std::size_t query, std::size_t vector,
                          const Products<V>& products) {
  enter(d32, w, query, vector, products.q0);
  enter(d32, w, query + 1, vector, products.q1);
  enter(d32, w, query + 2, vector, products.q2);
  enter(d32, w, query + 3, vector, products.q3);
}

void compare_all(Workspace& w) {
  const D32 d32;
  for (std::size_t tile = 0; tile < w.train_vectors; tile += kTileVectors) {
    const std::size_t end = std::min(w.train_vectors, tile + kTileVectors);
    for (std::size_t block = 0; block < w.query_blocks; ++block) {
      const std::size_t query = block * kQueryBlock;
      const std::int16_t* rows = w.query.get() + query * kDims;
      for (std::size_t v = tile; v < end; v += 2) {
        const auto products = multiply(d32, rows, w.train.get() + v * w.lanes * kDims);
        enter_all(d32, w, query, v, products.left);
        enter_all(d32, w, query, v + 1, products.right);
      }
    }
  }
}

void nearest(std::span<const Descriptor> query, std::span<const Descriptor> train,
             NearestNeighbours* result) {
  Workspace w = prepare(query, train);
  compare_all(w);
  for (std::size_t i = 0; i < query.size(); ++i) {
    std::size_t winner = i * w.lanes;
    for (std::size_t k = winner + 1; k < (i + 1) * w.lanes; ++k) {
      const bool tie = w.best[k] == w.best[winner];
      if (w.best[k] < w.best[winner] || (tie && w.index[k] < w.index[winner])) winner = k;
    }
    std::int32_t second = w.second[winner];
    for (std::size_t k = i * w.lanes; k < (i + 1) * w.lanes; ++k) {
      if (k != winner) second = std::min(second, w.best[k]);
    }
    result->best[i] = w.index[winner];
    result->best_distance[i] = w.best[winner];
    result->second_distance[i] = train.size() > 1 ? second : -1;
  }
  std::copy_n(w.train_index.get(), train.size(), result->best_query.begin());
}

}  // namespace HWY_NAMESPACE
}  // namespace hybrid_slam
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hybrid_slam {

HWY_EXPORT(nearest);

NearestNeighbours find_nearest(std::span<const Descriptor> query,
                               std::span<const Descriptor> train) {
  NearestNeighbours result;
  result.best.assign(query.size(), -1);
  result.best_distance.assign(query.size(), -1);
  result.second_distance.assign(query.size(), -1);
  result.best_query.assign(train.size(), -1);
  if (!query.empty() && !train.empty()) HWY_DYNAMIC_DISPATCH(nearest)(query, train, &result);
  return result;
}

std::vector<DescriptorMatch> match_brute_force(const FeatureSet& query, const FeatureSet& train,
                                               const BruteForceOptions& options) {
  std::vector<DescriptorMatch> matches;
  if (query.descriptors.empty() || train.descriptors.empty()) return matches;
  if (query.kind != train.kind) throw std::logic_error("descriptors of different kinds");
  const NearestNeighbours nearest = find_nearest(query.descriptors, train.descriptors);
  const std::int32_t max_distance = to_squared_bytes(options.max_descriptor_distance);
  for (std::size_t i = 0; i < nearest.best.size(); ++i) {
    const std::int32_t distance = nearest.best_distance[i];
    if (distance > max_distance) continue;
    if (options.ratio < 1 && !passes_ratio(distance, nearest.second_distance[i], options.ratio)) {
      continue;
    }
    const int q = static_cast<int>(i);
    const int t = nearest.best[i];
    if (options.mutual && nearest.best_query[static_cast<std::size_t>(t)] != q) continue;
    matches.push_back({q, t, distance});
  }
  return matches;
}

}  // namespace hybrid_slam
#endif  // HWY_ONCE
