#include "frontend/matching/patch_sampling.h"

#include <algorithm>
#include <array>
#include <cstdint>

// Compiled once per instruction set; the best one that the machine has is chosen at run time. No
// multiplication is fused with an addition (CMakeLists.txt): all give the same numbers.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frontend/matching/patch_sampling.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hybrid_slam {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Level = ImagePyramid::Level;
// Eight lanes at most: patches are 15 samples wide.
using Floats = hn::CappedTag<float, 8>;
using Doubles = hn::CappedTag<double, 4>;

constexpr float kGreyPerUnit = 1 / ImagePyramid::kUnits;
constexpr std::size_t kLanes = 8;  // room for the last vector of anything
constexpr std::size_t kMostInRow = 2 * (kMaxPatchHalfSize + 1) + 1;  // with the derivatives' rim

// Samples in a row of a patch.
HWY_INLINE std::size_t side_of(int half_size) {
  return 2 * static_cast<std::size_t>(half_size) + 1;
}

// Weights of Catmull-Rom interpolation at -1, 0, 1, 2 for t in [0, 1), which sum to `sum`.
template <class V>
struct Weights {
  V w0, w1, w2, w3;
};

template <class D, class V = hn::Vec<D>>
HWY_INLINE Weights<V> cubic_weights(D d, V t, float sum = 1) {
  const V t2 = hn::Mul(t, t);
  const V t3 = hn::Mul(t2, t);
  const V half = hn::Set(d, 0.5F * sum);
  const auto times = [&](float factor, V of) HWY_ATTR { return hn::Mul(hn::Set(d, factor), of); };
  return {hn::Mul(half, hn::Sub(hn::Sub(times(2, t2), t3), t)),
          hn::Mul(half, hn::Add(hn::Sub(times(3, t3), times(5, t2)), hn::Set(d, 2))),
          hn::Mul(half, hn::Add(hn::Sub(times(4, t2), times(3, t3)), t)),
          hn::Mul(half, hn::Sub(t3, t2))};
}

template <class V>
HWY_INLINE V weighted(const Weights<V>& w, V a, V b, V c, V e) {
  V sum = hn::Add(hn::Mul(w.w0, a), hn::Mul(w.w1, b));
  sum = hn::Add(sum, hn::Mul(w.w2, c));
  return hn::Add(sum, hn::Mul(w.w3, e));
}

// `store(i)` for vectors that cover 0 .. count - 1 and nothing else, of which there are as many as
// a vector has or more: the last one may overlap the one before.
template <class D, typename Store>
HWY_INLINE void for_each_vector(D d, std::size_t count, const Store& store) {
  const std::size_t last = count - hn::Lanes(d);
  for (std::size_t i = 0; i < last; i += hn::Lanes(d)) store(i);
  store(last);
}

template <class D>
HWY_INLINE hn::Vec<D> to_floats(D d, const std::uint16_t* from) {
  const hn::Rebind<std::int32_t, D> d32;
  const hn::Rebind<std::uint16_t, D> d16;
  return hn::ConvertTo(d, hn::PromoteTo(d32, hn::LoadU(d16, from)));
}

template <class D>
HWY_INLINE void square_by(D d, const Level& level, double cx, double cy, int half_size,
                          float* HWY_RESTRICT samples) {
  const double x = cx - half_size;
  const double y = cy - half_size;
  const int left = static_cast<int>(x);
  const int top = static_cast<int>(y);
  const auto wx = cubic_weights(d, hn::Set(d, static_cast<float>(x - left)));
  const auto wy = cubic_weights(d, hn::Set(d, static_cast<float>(y - top)), kGreyPerUnit);
  const std::size_t side = side_of(half_size);
  HWY_ALIGN float column[kMostInRow + 3];
  for (std::size_t v = 0; v < side; ++v, samples += side) {
    const std::uint16_t* p0 = level.row(top - 1 + static_cast<int>(v)) + (left - 1);
    const std::uint16_t* p1 = p0 + level.width;
    const std::uint16_t* p2 = p1 + level.width;
    const std::uint16_t* p3 = p2 + level.width;
    for_each_vector(d, side + 3, [&](std::size_t u) HWY_ATTR {
      const auto sum = weighted(wy, to_floats(d, p0 + u), to_floats(d, p1 + u),
                                to_floats(d, p2 + u), to_floats(d, p3 + u));
      hn::StoreU(sum, d, column + u);
    });
    for_each_vector(d, side, [&](std::size_t u) HWY_ATTR {
      const float* c = column + u;
      const auto sum = weighted(wx, hn::LoadU(d, c), hn::LoadU(d, c + 1), hn::LoadU(d, c + 2),
                                hn::LoadU(d, c + 3));
      hn::StoreU(sum, d, samples + u);
    });
  }
}

void square(const Level& level, double cx, double cy, int half_size, float* samples) {
  if (side_of(half_size) >= hn::Lanes(Floats())) {
    square_by(Floats(), level, cx, cy, half_size, samples);
  } else {
    square_by(hn::CappedTag<float, 1>(), level, cx, cy, half_size, samples);
  }
}

// From each of these places in the level on, four pixels.
struct FourPixels {
  hn::Vec<Floats> p0, p1, p2, p3;
};

#if HWY_TARGET == HWY_SCALAR
HWY_INLINE FourPixels read_four(const std::uint16_t* pixels, const std::int32_t* at) {
  const Floats d;
  const std::uint16_t* p = pixels + at[0];
  return {hn::Set(d, p[0]), hn::Set(d, p[1]), hn::Set(d, p[2]), hn::Set(d, p[3])};
}
#else
HWY_INLINE FourPixels read_four(const std::uint16_t* pixels, const std::int32_t* at) {
  const Floats d;
  const hn::RebindToSigned<Floats> d32;
  const hn::RebindToUnsigned<Floats> u32;
  const hn::Repartition<std::uint64_t, Floats> u64;
  const hn::RebindToSigned<decltype(u64)> d64;
  const hn::Rebind<std::int32_t, decltype(u64)> half32;
  const auto read = [&](const std::int32_t* from) HWY_ATTR {
    const auto bytes = hn::ShiftLeft<1>(hn::PromoteTo(d64, hn::LoadU(half32, from)));
    const auto* base = reinterpret_cast<const std::uint64_t*>(pixels);
    return hn::BitCast(u32, hn::GatherOffset(u64, base, bytes));
  };
  const auto low = read(at);
  const auto high = read(at + hn::Lanes(u64));
  const auto first = hn::ConcatEven(u32, high, low);
  const auto second = hn::ConcatOdd(u32, high, low);
  const auto mask = hn::Set(u32, 0xFFFFU);
  const auto number = [&](auto of) HWY_ATTR { return hn::ConvertTo(d, hn::BitCast(d32, of)); };
  return {number(hn::And(first, mask)), number(hn::ShiftRight<16>(first)),
          number(hn::And(second, mask)), number(hn::ShiftRight<16>(second))};
}
#endif

// Where the samples of a row lie: the first of the 4 x 4 pixels around, and how far from the
// second.
struct RowOfPlaces {
  std::array<std::int32_t, kMostInRow + kLanes> corner;
  std::array<float, kMostInRow + kLanes> tx, ty;
};

HWY_INLINE void find_places(const Level& level, const Eigen::Vector2d& centre,
                            const Eigen::Vector2d& to_row, const Eigen::Vector2d& step,
                            int half_size, RowOfPlaces* places) {
  const std::size_t count = side_of(half_size);
  for (std::size_t i = 0; i < count; ++i) {
    const int u = static_cast<int>(i) - half_size;
    const double x = centre.x() + step.x() * u + to_row.x();
    const double y = centre.y() + step.y() * u + to_row.y();
    const int left = static_cast<int>(x);
    const int top = static_cast<int>(y);
    places->corner[i] = (top - 1) * level.width + (left - 1);
    places->tx[i] = static_cast<float>(x - left);
    places->ty[i] = static_cast<float>(y - top);
  }
  for (std::size_t i = count; i < count + kLanes; ++i) {  // of no account
    places->corner[i] = places->corner[0];
    places->tx[i] = places->ty[i] = 0;
  }
}

void warped(const Level& level, const Eigen::Vector2d& centre, const Eigen::Matrix2d& warp,
            int half_size, float* HWY_RESTRICT samples) {
  const Floats d;
  const std::size_t side = side_of(half_size);
  RowOfPlaces places;
  HWY_ALIGN float row[kMostInRow + kLanes];
  for (int v = -half_size; v <= half_size; ++v, samples += side) {
    find_places(level, centre, warp.col(1) * v, warp.col(0), half_size, &places);
    for (std::size_t i = 0; i < side; i += hn::Lanes(d)) {
      const auto wx = cubic_weights(d, hn::LoadU(d, places.tx.data() + i));
      const auto along = [&](int j) HWY_ATTR {
        const FourPixels p = read_four(level.pixels.data() + std::ptrdiff_t{j} * level.width,
                                       places.corner.data() + i);
        return weighted(wx, p.p0, p.p1, p.p2, p.p3);
      };
      const auto wy = cubic_weights(d, hn::LoadU(d, places.ty.data() + i), kGreyPerUnit);
      hn::StoreU(weighted(wy, along(0), along(1), along(2), along(3)), d, row + i);
    }
    for (std::size_t i = 0; i < side; ++i) samples[i] = row[i];
  }
}

// Rows of the columns side by side.
constexpr std::size_t kRow = kSummedColumns;
constexpr std::size_t kChunk = 64;  // rows at a time: they stay in the first-level cache

// Eight sums, or vectors of them. Products are exact, as those of two numbers of single precision
// are in double: it is all the same whether a machine fuses them with the addition.
struct Sums {
  hn::Vec<Doubles> s0, s1, s2, s3, s4, s5, s6, s7;
};

HWY_INLINE Sums load(const double* from) {
  const Doubles d;
  const auto at = [&](std::size_t i) HWY_ATTR { return hn::LoadU(d, from + i * kRow); };
  return {at(0), at(1), at(2), at(3), at(4), at(5), at(6), at(7)};
}

HWY_INLINE void store(const Sums& sums, double* to) {
  const Doubles d;
  hn::StoreU(sums.s0, d, to);
  hn::StoreU(sums.s1, d, to + kRow);
  hn::StoreU(sums.s2, d, to + 2 * kRow);
  hn::StoreU(sums.s3, d, to + 3 * kRow);
  hn::StoreU(sums.s4, d, to + 4 * kRow);
  hn::StoreU(sums.s5, d, to + 5 * kRow);
  hn::StoreU(sums.s6, d, to + 6 * kRow);
  hn::StoreU(sums.s7, d, to + 7 * kRow);
}

HWY_INLINE hn::Vec<Doubles> plus(hn::Vec<Doubles> sum, double a, hn::Vec<Doubles> b) {
  return hn::MulAdd(hn::Set(Doubles(), a), b, sum);
}

HWY_INLINE void add_products(const double* HWY_RESTRICT rows, std::size_t count, std::size_t column,
                             double* HWY_RESTRICT sums) {
  Sums s = load(sums + column);
  for (const double* row = rows; row != rows + count * kRow; row += kRow) {
    const auto v = hn::LoadU(Doubles(), row + column);
    s.s0 = plus(s.s0, row[0], v);
    s.s1 = plus(s.s1, row[1], v);
    s.s2 = plus(s.s2, row[2], v);
    s.s3 = plus(s.s3, row[3], v);
    s.s4 = plus(s.s4, row[4], v);
    s.s5 = plus(s.s5, row[5], v);
    s.s6 = plus(s.s6, row[6], v);
    s.s7 = plus(s.s7, row[7], v);
  }
  store(s, sums + column);
}

HWY_INLINE void to_rows(const float* HWY_RESTRICT columns, std::size_t stride, std::size_t count,
                        double* HWY_RESTRICT rows) {
  for (std::size_t j = 0; j < kRow; ++j) {
    for (std::size_t i = 0; i < count; ++i) rows[i * kRow + j] = columns[j * stride + i];
  }
}

void products(const float* columns, std::size_t count, double* HWY_RESTRICT sums) {
  const std::size_t lanes = hn::Lanes(Doubles());
  HWY_ALIGN double rows[kChunk * kRow];
  for (std::size_t first = 0; first < count; first += kChunk) {
    const std::size_t size = std::min(kChunk, count - first);
    to_rows(columns + first, count, size, rows);
    for (std::size_t j = 0; j < kRow; j += lanes) add_products(rows, size, j, sums);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace hybrid_slam
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hybrid_slam {

HWY_EXPORT(square);
HWY_EXPORT(warped);
HWY_EXPORT(products);

void sample_square(const ImagePyramid::Level& level, double cx, double cy, int half_size,
                   float* samples) {
  HWY_DYNAMIC_DISPATCH(square)(level, cx, cy, half_size, samples);
}

void sample_warped(const ImagePyramid::Level& level, const Eigen::Vector2d& centre,
                   const Eigen::Matrix2d& warp, int half_size, float* samples) {
  HWY_DYNAMIC_DISPATCH(warped)(level, centre, warp, half_size, samples);
}

SummedProducts sums_of_products(const float* columns, std::size_t rows) {
  SummedProducts sums = SummedProducts::Zero();
  HWY_DYNAMIC_DISPATCH(products)(columns, rows, sums.data());
  return sums;
}

}  // namespace hybrid_slam
#endif  // HWY_ONCE
