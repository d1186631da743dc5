#include "frontend/features/cpu/row_kernels.h"

// Compiled once per instruction set; the best one that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frontend/features/cpu/row_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hybrid_slam::sift {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, kRowPadding>;
using Vector = hn::Vec<Floats>;

// Four vectors at once: each weight is loaded once for all of them.
struct Sums {
  Vector v0, v1, v2, v3;
};

HWY_INLINE Sums four_sums(const float* const* HWY_RESTRICT rows, std::size_t count,
                          const float* HWY_RESTRICT weights, std::size_t x) {
  const Floats d;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t pairs = count / 2;
  Sums s{hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  if (count % 2 == 1) {
    const Vector weight = hn::Set(d, weights[pairs]);
    const float* row = rows[pairs] + x;
    s.v0 = hn::Mul(weight, hn::LoadU(d, row));
    s.v1 = hn::Mul(weight, hn::LoadU(d, row + lanes));
    s.v2 = hn::Mul(weight, hn::LoadU(d, row + 2 * lanes));
    s.v3 = hn::Mul(weight, hn::LoadU(d, row + 3 * lanes));
  }
  for (std::size_t i = 0; i < pairs; ++i) {
    const Vector weight = hn::Set(d, weights[i]);
    const float* a = rows[i] + x;
    const float* b = rows[count - 1 - i] + x;
    const auto both = [&](std::size_t at)
                          HWY_ATTR { return hn::Add(hn::LoadU(d, a + at), hn::LoadU(d, b + at)); };
    s.v0 = hn::MulAdd(weight, both(0), s.v0);
    s.v1 = hn::MulAdd(weight, both(lanes), s.v1);
    s.v2 = hn::MulAdd(weight, both(2 * lanes), s.v2);
    s.v3 = hn::MulAdd(weight, both(3 * lanes), s.v3);
  }
  return s;
}

HWY_INLINE Vector one_sum(const float* const* HWY_RESTRICT rows, std::size_t count,
                          const float* HWY_RESTRICT weights, std::size_t x) {
  const Floats d;
  const std::size_t pairs = count / 2;
  Vector sum = hn::Zero(d);
  if (count % 2 == 1) sum = hn::Mul(hn::Set(d, weights[pairs]), hn::LoadU(d, rows[pairs] + x));
  for (std::size_t i = 0; i < pairs; ++i) {
    const Vector both = hn::Add(hn::LoadU(d, rows[i] + x), hn::LoadU(d, rows[count - 1 - i] + x));
    sum = hn::MulAdd(hn::Set(d, weights[i]), both, sum);
  }
  return sum;
}

// `store(x, sum)` for every vector of the row.
template <typename Store>
HWY_INLINE void for_each_sum(const float* const* rows, std::size_t count, const float* weights,
                             std::size_t width, const Store& store) {
  const std::size_t lanes = hn::Lanes(Floats());
  std::size_t x = 0;
  for (; x + 4 * lanes <= width + lanes - 1; x += 4 * lanes) {
    const Sums s = four_sums(rows, count, weights, x);
    store(x, s.v0);
    store(x + lanes, s.v1);
    store(x + 2 * lanes, s.v2);
    store(x + 3 * lanes, s.v3);
  }
  for (; x < width; x += lanes) store(x, one_sum(rows, count, weights, x));
}

void sum_rows(const float* const* rows, std::size_t count, const float* weights, std::size_t width,
              float* HWY_RESTRICT out) {
  const Floats d;
  for_each_sum(rows, count, weights, width,
               [&](std::size_t x, Vector sum) HWY_ATTR { hn::StoreU(sum, d, out + x); });
}

void sum_rows_and_subtract(const float* const* rows, std::size_t count, const float* weights,
                           std::size_t width, float* HWY_RESTRICT out,
                           const float* HWY_RESTRICT below, float* HWY_RESTRICT difference) {
  const Floats d;
  for_each_sum(rows, count, weights, width, [&](std::size_t x, Vector sum) HWY_ATTR {
    hn::StoreU(sum, d, out + x);
    hn::StoreU(hn::Sub(sum, hn::LoadU(d, below + x)), d, difference + x);
  });
}

// Two vectors of each of the four sums, of which those from `First` to `Last` have a weight for the
// row.
struct Block {
  Sums left, right;
};

template <int First, int Last>
HWY_INLINE void add_to_block(const float* row, const float* weight, Block& b) {
  const Floats d;
  const Vector left = hn::LoadU(d, row);
  const Vector right = hn::LoadU(d, row + hn::Lanes(d));
  const auto add = [&](const float* of, Vector& to_left, Vector& to_right) HWY_ATTR {
    const Vector w = hn::Set(d, *of);
    to_left = hn::MulAdd(w, left, to_left);
    to_right = hn::MulAdd(w, right, to_right);
  };
  if constexpr (First <= 0 && 0 <= Last) add(weight, b.left.v0, b.right.v0);
  if constexpr (First <= 1 && 1 <= Last) add(weight - 1, b.left.v1, b.right.v1);
  if constexpr (First <= 2 && 2 <= Last) add(weight - 2, b.left.v2, b.right.v2);
  if constexpr (First <= 3 && 3 <= Last) add(weight - 3, b.left.v3, b.right.v3);
}

void sum_block(const float* const* HWY_RESTRICT rows, std::size_t count,
               const float* HWY_RESTRICT weights, std::size_t width, float* const* out) {
  static_assert(kBlockRows == 4);
  const Floats d;
  const std::size_t lanes = hn::Lanes(d);
  for (std::size_t x = 0; x < width; x += 2 * lanes) {
    const Vector zero = hn::Zero(d);
    Block b{{zero, zero, zero, zero}, {zero, zero, zero, zero}};
    add_to_block<0, 0>(rows[0] + x, weights, b);
    add_to_block<0, 1>(rows[1] + x, weights + 1, b);
    add_to_block<0, 2>(rows[2] + x, weights + 2, b);
    for (std::size_t i = 3; i < count; ++i) add_to_block<0, 3>(rows[i] + x, weights + i, b);
    add_to_block<1, 3>(rows[count] + x, weights + count, b);
    add_to_block<2, 3>(rows[count + 1] + x, weights + count + 1, b);
    add_to_block<3, 3>(rows[count + 2] + x, weights + count + 2, b);
    const auto store = [&](Vector left, Vector right, float* to) HWY_ATTR {
      hn::StoreU(left, d, to + x);
      if (x + lanes < width) hn::StoreU(right, d, to + x + lanes);
    };
    store(b.left.v0, b.right.v0, out[0]);
    store(b.left.v1, b.right.v1, out[1]);
    store(b.left.v2, b.right.v2, out[2]);
    store(b.left.v3, b.right.v3, out[3]);
  }
}

void bytes_to_floats(const std::uint8_t* HWY_RESTRICT in, std::size_t width,
                     float* HWY_RESTRICT out) {
  const Floats d;
  const hn::Rebind<std::int32_t, Floats> d32;
  const hn::Rebind<std::uint8_t, Floats> d8;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t x = 0;
  for (; x + lanes <= width; x += lanes) {
    hn::StoreU(hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d8, in + x))), d, out + x);
  }
  for (; x < width; ++x) out[x] = in[x];  // nothing may be read beyond an image
}

void interleave_rows(const float* HWY_RESTRICT even, const float* HWY_RESTRICT odd,
                     std::size_t width, float* HWY_RESTRICT out) {
  const Floats d;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t x = 0;
  for (; x + lanes <= width; x += lanes) {
    hn::StoreInterleaved2(hn::LoadU(d, even + x), hn::LoadU(d, odd + x), d, out + 2 * x);
  }
  for (; x < width; ++x) {
    out[2 * x] = even[x];
    out[2 * x + 1] = odd[x];
  }
}

struct Range {
  Vector smallest, largest;
};

HWY_INLINE Range extend(Range range, Vector v) {
  return {hn::Min(range.smallest, v), hn::Max(range.largest, v)};
}

HWY_INLINE Range range_of(Vector a, Vector b) { return {hn::Min(a, b), hn::Max(a, b)}; }

// Three samples of each of three rows.
HWY_INLINE Range range_of_layer(const float* const* rows, std::size_t x) {
  const Floats d;
  Range range = range_of(hn::LoadU(d, rows[0] + x - 1), hn::LoadU(d, rows[0] + x));
  range = extend(range, hn::LoadU(d, rows[0] + x + 1));
  for (std::size_t row = 1; row < 3; ++row) {
    range = extend(range, hn::LoadU(d, rows[row] + x - 1));
    range = extend(range, hn::LoadU(d, rows[row] + x));
    range = extend(range, hn::LoadU(d, rows[row] + x + 1));
  }
  return range;
}

// Three samples of one row, and one beside the sample in the middle.
HWY_INLINE Range range_beside(const float* row, std::size_t x, Vector beside) {
  const Floats d;
  Range range = range_of(beside, hn::LoadU(d, row + x - 1));
  range = extend(range, hn::LoadU(d, row + x));
  return extend(range, hn::LoadU(d, row + x + 1));
}

std::size_t extrema_of_row(const float* const* rows, std::size_t first, std::size_t last,
                           float threshold, int* found) {
  const Floats d;
  const std::size_t lanes = hn::Lanes(d);
  const Vector above = hn::Set(d, threshold);
  const Vector below = hn::Neg(above);
  std::size_t count = 0;
  for (std::size_t x = first; x < last; x += lanes) {
    const Vector v = hn::LoadU(d, rows[4] + x);
    auto maxima = hn::Gt(v, above);
    auto minima = hn::Lt(v, below);
    if (hn::AllFalse(d, hn::Or(maxima, minima))) continue;
    const Range before = range_beside(rows[3], x, hn::LoadU(d, rows[4] + x - 1));
    const Range after = range_beside(rows[5], x, hn::LoadU(d, rows[4] + x + 1));
    maxima = hn::And(maxima, hn::And(hn::Ge(v, before.largest), hn::Gt(v, after.largest)));
    minima = hn::And(minima, hn::And(hn::Le(v, before.smallest), hn::Lt(v, after.smallest)));
    if (hn::AllFalse(d, hn::Or(maxima, minima))) continue;
    const Range lower = range_of_layer(rows, x);
    const Range upper = range_of_layer(rows + 6, x);
    maxima = hn::And(maxima, hn::And(hn::Ge(v, lower.largest), hn::Gt(v, upper.largest)));
    minima = hn::And(minima, hn::And(hn::Le(v, lower.smallest), hn::Lt(v, upper.smallest)));
    const auto extrema = hn::Or(maxima, minima);
    if (hn::AllFalse(d, extrema)) continue;
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, extrema, bytes);
    for (std::size_t lane = 0; lane < lanes && x + lane < last; ++lane) {
      if (bytes[lane / 8] >> (lane % 8) & 1) found[count++] = static_cast<int>(x + lane);
    }
  }
  return count;
}

}  // namespace HWY_NAMESPACE
}  // namespace hybrid_slam::sift
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hybrid_slam::sift {

HWY_EXPORT(sum_rows);
HWY_EXPORT(sum_rows_and_subtract);
HWY_EXPORT(sum_block);
HWY_EXPORT(bytes_to_floats);
HWY_EXPORT(interleave_rows);
HWY_EXPORT(extrema_of_row);

void symmetric_sum(const float* const* rows, std::size_t count, const float* weights,
                   std::size_t width, float* out) {
  HWY_DYNAMIC_DISPATCH(sum_rows)(rows, count, weights, width, out);
}

void symmetric_sum_and_difference(const float* const* rows, std::size_t count, const float* weights,
                                  std::size_t width, float* out, const float* below,
                                  float* difference) {
  HWY_DYNAMIC_DISPATCH(sum_rows_and_subtract)
  (rows, count, weights, width, out, below, difference);
}

void sum_columns(const float* const* rows, std::size_t count, const float* weights,
                 std::size_t width, float* const* out) {
  HWY_DYNAMIC_DISPATCH(sum_block)(rows, count, weights, width, out);
}

void to_floats(const std::uint8_t* in, std::size_t width, float* out) {
  HWY_DYNAMIC_DISPATCH(bytes_to_floats)(in, width, out);
}

void interleave(const float* even, const float* odd, std::size_t width, float* out) {
  HWY_DYNAMIC_DISPATCH(interleave_rows)(even, odd, width, out);
}

std::size_t find_extrema(const float* const* rows, std::size_t first, std::size_t last,
                         float threshold, int* found) {
  return HWY_DYNAMIC_DISPATCH(extrema_of_row)(rows, first, last, threshold, found);
}

}  // namespace hybrid_slam::sift
#endif  // HWY_ONCE
