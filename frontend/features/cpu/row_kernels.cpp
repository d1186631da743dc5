#include "frontend/features/cpu/row_kernels.h"

#include <algorithm>
#include <array>
#include <bit>
#include <iterator>

#include "frontend/features/definition/extremum.h"
#include "frontend/features/definition/patch.h"

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

// The sizes of the default scales' kernels, which are constants below so that loops are unrolled:
// the weights, and what several sums read, stay in registers. 0 stands for all others.
constexpr std::size_t kSizes[] = {9, 11, 13, 17, 21, 0};

template <typename Function>
Function for_size(std::size_t count, const std::array<Function, std::size(kSizes)>& functions) {
  std::size_t i = 0;
  while (kSizes[i] != 0 && kSizes[i] != count) ++i;
  return functions[i];
}

// Eight lanes: of the reads of sixteen, which lie anywhere, nearly all would cross a line of the
// cache.
using Eight = hn::CappedTag<float, 8>;

template <std::size_t kCount>
void blur_row(const float* HWY_RESTRICT row, std::size_t count, const float* HWY_RESTRICT weights,
              std::size_t width, float* HWY_RESTRICT out, const float* HWY_RESTRICT below,
              float* HWY_RESTRICT difference) {
  const Eight d;
  using V = hn::Vec<Eight>;
  const std::size_t lanes = hn::Lanes(d);
  const std::size_t last = (kCount > 0 ? kCount : count) - 1;
  const std::size_t middle = last / 2;
  for (std::size_t x = 0; x < width; x += 2 * lanes) {
    const float* at = row + x;
    const V weight = hn::Set(d, weights[middle]);
    V left = hn::Mul(weight, hn::LoadU(d, at + middle));
    V right = hn::Mul(weight, hn::LoadU(d, at + middle + lanes));
#pragma GCC unroll 16
    for (std::size_t i = 0; i < middle; ++i) {
      const V w = hn::Set(d, weights[i]);
      const float* from = at + i;
      const float* to = at + last - i;
      left = hn::MulAdd(w, hn::Add(hn::LoadU(d, from), hn::LoadU(d, to)), left);
      right = hn::MulAdd(w, hn::Add(hn::LoadU(d, from + lanes), hn::LoadU(d, to + lanes)), right);
    }
    hn::StoreU(left, d, out + x);
    hn::StoreU(right, d, out + x + lanes);
    hn::StoreU(hn::Sub(left, hn::LoadU(d, below + x)), d, difference + x);
    hn::StoreU(hn::Sub(right, hn::LoadU(d, below + x + lanes)), d, difference + x + lanes);
  }
}

void blur_row_and_subtract(const float* row, std::size_t count, const float* weights,
                           std::size_t width, float* out, const float* below, float* difference) {
  const std::array functions{&blur_row<9>,  &blur_row<11>, &blur_row<13>,
                             &blur_row<17>, &blur_row<21>, &blur_row<0>};
  for_size(count, functions)(row, count, weights, width, out, below, difference);
}

template <std::size_t kCount>
void blur_columns(const float* const* HWY_RESTRICT rows, std::size_t count,
                  const float* HWY_RESTRICT weights, std::size_t width,
                  float* const* HWY_RESTRICT out) {
  static_assert(kBlockRows == 4);
  const Floats d;
  const std::size_t last = (kCount > 0 ? kCount : count) - 1;
  const std::size_t middle = last / 2;
  for (std::size_t x = 0; x < width; x += hn::Lanes(d)) {
    const auto at = [&](std::size_t row) HWY_ATTR { return hn::LoadU(d, rows[row] + x); };
    const Vector weight = hn::Set(d, weights[middle]);
    Sums s{hn::Mul(weight, at(middle)), hn::Mul(weight, at(middle + 1)),
           hn::Mul(weight, at(middle + 2)), hn::Mul(weight, at(middle + 3))};
#pragma GCC unroll 16
    for (std::size_t i = 0; i < middle; ++i) {
      const Vector w = hn::Set(d, weights[i]);
      const auto both = [&](std::size_t j)
                            HWY_ATTR { return hn::Add(at(j + i), at(j + last - i)); };
      s.v0 = hn::MulAdd(w, both(0), s.v0);
      s.v1 = hn::MulAdd(w, both(1), s.v1);
      s.v2 = hn::MulAdd(w, both(2), s.v2);
      s.v3 = hn::MulAdd(w, both(3), s.v3);
    }
    hn::StoreU(s.v0, d, out[0] + x);
    hn::StoreU(s.v1, d, out[1] + x);
    hn::StoreU(s.v2, d, out[2] + x);
    hn::StoreU(s.v3, d, out[3] + x);
  }
}

void sum_block(const float* const* rows, std::size_t count, const float* weights, std::size_t width,
               float* const* out) {
  const std::array functions{&blur_columns<9>,  &blur_columns<11>, &blur_columns<13>,
                             &blur_columns<17>, &blur_columns<21>, &blur_columns<0>};
  for_size(count, functions)(rows, count, weights, width, out);
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

void floats_to_fixed(const float* HWY_RESTRICT in, std::size_t width,
                     std::uint16_t* HWY_RESTRICT out) {
  const Floats d;
  const hn::Rebind<std::uint16_t, Floats> d16;
  const std::size_t lanes = hn::Lanes(d);
  const auto fixed = [&](std::size_t x) HWY_ATTR {
    return hn::DemoteTo(d16,
                        hn::NearestInt(hn::Mul(hn::LoadU(d, in + x), hn::Set(d, kLevelUnits))));
  };
  std::size_t x = 0;
  for (; x + lanes <= width; x += lanes) hn::StoreU(fixed(x), d16, out + x);
  if (x == width) return;
  HWY_ALIGN std::uint16_t rest[kRowPadding];
  hn::StoreU(fixed(x), d16, rest);
  std::copy_n(rest, width - x, out + x);
}

void fixed_to_floats(const std::uint16_t* HWY_RESTRICT in, std::size_t width,
                     float* HWY_RESTRICT out) {
  const Floats d;
  const hn::Rebind<std::int32_t, Floats> d32;
  const hn::Rebind<std::uint16_t, Floats> d16;
  const std::size_t lanes = hn::Lanes(d);
  const Vector unit = hn::Set(d, 1 / kLevelUnits);
  std::size_t x = 0;
  for (; x + lanes <= width; x += lanes) {
    const Vector value = hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, in + x)));
    hn::StoreU(hn::Mul(value, unit), d, out + x);
  }
  for (; x < width; ++x) out[x] = static_cast<float>(in[x]) / kLevelUnits;
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

HWY_INLINE Range range_of(Range a, Range b) {
  return {hn::Min(a.smallest, b.smallest), hn::Max(a.largest, b.largest)};
}

// Of one column of three rows.
HWY_INLINE Range range_of_column(const float* const* rows, std::size_t x) {
  const Floats d;
  const Vector a = hn::LoadU(d, rows[0] + x);
  const Vector b = hn::LoadU(d, rows[1] + x);
  const Vector c = hn::LoadU(d, rows[2] + x);
  return {hn::Min(hn::Min(a, b), c), hn::Max(hn::Max(a, b), c)};
}

void ranges_of_columns(const float* const* rows, std::size_t layers, std::size_t width,
                       float* const* smallest, float* const* largest) {
  const Floats d;
  for (std::size_t x = 0; x < width; x += hn::Lanes(d)) {
    Range below = range_of_column(rows, x);
    Range here = range_of_column(rows + 3, x);
    for (std::size_t layer = 0; layer < layers; ++layer) {
      const Range above = range_of_column(rows + 3 * (layer + 2), x);
      const Range all = range_of(range_of(below, here), above);
      hn::StoreU(all.smallest, d, smallest[layer] + x);
      hn::StoreU(all.largest, d, largest[layer] + x);
      below = here;
      here = above;
    }
  }
}

std::size_t extrema_of_row(const float* const* rows, const float* smallest, const float* largest,
                           std::size_t first, std::size_t last, float threshold, int* found) {
  const Floats d;
  const std::size_t lanes = hn::Lanes(d);
  const Vector above = hn::Set(d, threshold);
  const Vector below = hn::Neg(above);
  const auto three = [&](const float* of, std::size_t x, const auto& chosen) HWY_ATTR {
    return chosen(chosen(hn::LoadU(d, of + x - 1), hn::LoadU(d, of + x + 1)), hn::LoadU(d, of + x));
  };
  const auto max = [](Vector a, Vector b) HWY_ATTR { return hn::Max(a, b); };
  const auto min = [](Vector a, Vector b) HWY_ATTR { return hn::Min(a, b); };
  std::size_t count = 0;
  // From the second vector on they begin at a multiple of their size: half of the reads then lie in
  // one line of the cache.
  for (std::size_t x = first, next = 0; x < last; x = next) {
    next = std::min((x / lanes + 1) * lanes, last);
    const Vector v = hn::LoadU(d, rows[4] + x);
    const auto high = hn::Gt(v, above);
    const auto low = hn::Lt(v, below);
    if (hn::AllFalse(d, hn::Or(high, low))) continue;
    const auto maxima = hn::And(high, hn::Ge(v, three(largest, x, max)));
    const auto minima = hn::And(low, hn::Le(v, three(smallest, x, min)));
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, hn::Or(maxima, minima), bytes);
    unsigned candidates = (bytes[0] | unsigned{bytes[1]} << 8) & ((1U << (next - x)) - 1);
    for (; candidates != 0; candidates &= candidates - 1) {
      const std::size_t column = x + static_cast<std::size_t>(std::countr_zero(candidates));
      const float* at[9];
      for (std::size_t i = 0; i < 9; ++i) at[i] = rows[i] + column;
      if (is_extremum(at)) found[count++] = static_cast<int>(column);
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
HWY_EXPORT(blur_row_and_subtract);
HWY_EXPORT(sum_block);
HWY_EXPORT(bytes_to_floats);
HWY_EXPORT(floats_to_fixed);
HWY_EXPORT(fixed_to_floats);
HWY_EXPORT(interleave_rows);
HWY_EXPORT(ranges_of_columns);
HWY_EXPORT(extrema_of_row);

void symmetric_sum(const float* const* rows, std::size_t count, const float* weights,
                   std::size_t width, float* out) {
  HWY_DYNAMIC_DISPATCH(sum_rows)(rows, count, weights, width, out);
}

void symmetric_sum_and_difference(const float* row, std::size_t count, const float* weights,
                                  std::size_t width, float* out, const float* below,
                                  float* difference) {
  HWY_DYNAMIC_DISPATCH(blur_row_and_subtract)(row, count, weights, width, out, below, difference);
}

void sum_columns(const float* const* rows, std::size_t count, const float* weights,
                 std::size_t width, float* const* out) {
  HWY_DYNAMIC_DISPATCH(sum_block)(rows, count, weights, width, out);
}

void to_floats(const std::uint8_t* in, std::size_t width, float* out) {
  HWY_DYNAMIC_DISPATCH(bytes_to_floats)(in, width, out);
}

void to_fixed_point(const float* in, std::size_t width, std::uint16_t* out) {
  HWY_DYNAMIC_DISPATCH(floats_to_fixed)(in, width, out);
}

void from_fixed_point(const std::uint16_t* in, std::size_t width, float* out) {
  HWY_DYNAMIC_DISPATCH(fixed_to_floats)(in, width, out);
}

void interleave(const float* even, const float* odd, std::size_t width, float* out) {
  HWY_DYNAMIC_DISPATCH(interleave_rows)(even, odd, width, out);
}

void column_ranges(const float* const* rows, std::size_t layers, std::size_t width,
                   float* const* smallest, float* const* largest) {
  HWY_DYNAMIC_DISPATCH(ranges_of_columns)(rows, layers, width, smallest, largest);
}

std::size_t find_extrema(const float* const* rows, const float* smallest, const float* largest,
                         std::size_t first, std::size_t last, float threshold, int* found) {
  return HWY_DYNAMIC_DISPATCH(extrema_of_row)(rows, smallest, largest, first, last, threshold,
                                              found);
}

}  // namespace hybrid_slam::sift
#endif  // HWY_ONCE
