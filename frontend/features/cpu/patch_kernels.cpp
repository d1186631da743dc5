#include "frontend/features/cpu/patch_kernels.h"

#include <algorithm>
#include <cstddef>
#include <cstring>

#include <hwy/cache_control.h>

#include "frontend/features/cpu/patch_tables.h"
#include "frontend/features/definition/descriptor.h"
#include "frontend/features/definition/orientation.h"

// Compiled once per instruction set; the best one that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frontend/features/cpu/patch_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hybrid_slam::sift {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Eight lanes at most: the bins of a cell, and grids of few columns.
using Floats = hn::CappedTag<float, kDescriptorBins>;
using Vector = hn::Vec<Floats>;
using Integers = hn::Vec<hn::Rebind<std::int32_t, Floats>>;

// The samples at these places and, in the upper half, the next ones: four bytes at a time, which is
// no slower than a gather.
HWY_INLINE Integers read_pairs(const std::uint16_t* samples, Integers index) {
  const hn::Rebind<std::int32_t, Floats> d32;
  HWY_ALIGN std::int32_t at[kDescriptorBins];
  hn::Store(index, d32, at);
  for (std::size_t i = 0; i < hn::Lanes(d32); ++i) std::memcpy(at + i, samples + at[i], 4);
  return hn::Load(d32, at);
}

// read_level() for a vector of places.
HWY_INLINE Vector read_places(const FixedLevel& level, Vector x, Vector y) {
  const Floats d;
  const hn::Rebind<std::int32_t, Floats> d32;
  const auto whole_and_rest = [&](Vector& at, int size) HWY_ATTR {
    at = hn::Min(hn::Max(at, hn::Zero(d)), hn::Set(d, static_cast<float>(size - 1)));
    const auto whole = hn::Min(hn::ConvertTo(d32, at), hn::Set(d32, size - 2));
    at = hn::Sub(at, hn::ConvertTo(d, whole));
    return whole;
  };
  const auto column = whole_and_rest(x, level.width);
  const auto row = whole_and_rest(y, level.height);
  const auto stride = hn::Set(d32, static_cast<std::int32_t>(level.stride));
  const auto index = hn::Add(hn::Mul(row, stride), column);
  const auto above = read_pairs(level.samples, index);
  const auto below = read_pairs(level.samples + level.stride, index);
  const auto left = [&](auto pair)
                        HWY_ATTR { return hn::ConvertTo(d, hn::And(pair, hn::Set(d32, 0xFFFF))); };
  const auto right = [&](auto pair) HWY_ATTR {
    return hn::ConvertTo(d, hn::BitCast(d32, hn::ShiftRight<16>(hn::BitCast(
                                                 hn::RebindToUnsigned<decltype(d32)>(), pair))));
  };
  const Vector a = left(above);
  const Vector b = right(above);
  const Vector c = left(below);
  const Vector e = right(below);
  const Vector upper = hn::MulAdd(x, hn::Sub(b, a), a);
  const Vector lower = hn::MulAdd(x, hn::Sub(e, c), c);
  return hn::MulAdd(y, hn::Sub(lower, upper), upper);
}

// Fills the rows of a square grid. A row has `stride` samples, of which those beyond `side` are of
// no account.
HWY_INLINE void read_grid(const FixedLevel& level, const PatchFrame& frame, std::size_t side,
                          std::size_t stride, float* HWY_RESTRICT samples) {
  const Floats d;
  const float middle = 0.5F * static_cast<float>(side - 1);
  for (std::size_t row = 0; row < side; ++row) {
    const float v = static_cast<float>(row) - middle;
    const Vector x0 = hn::Set(d, frame.x - v * frame.step_y);
    const Vector y0 = hn::Set(d, frame.y + v * frame.step_x);
    for (std::size_t column = 0; column < side; column += hn::Lanes(d)) {
      const Vector u = hn::Iota(d, static_cast<float>(column) - middle);
      const Vector x = hn::MulAdd(u, hn::Set(d, frame.step_x), x0);
      const Vector y = hn::MulAdd(u, hn::Set(d, frame.step_y), y0);
      hn::StoreU(read_places(level, x, y), d, samples + row * stride + column);
    }
  }
}

// turn_of() for a vector.
HWY_INLINE Vector turns_of(Vector x, Vector y) {
  const Floats d;
  const Vector ax = hn::Abs(x);
  const Vector ay = hn::Abs(y);
  const Vector larger = hn::Max(hn::Max(ax, ay), hn::Set(d, kSmallestGradient));
  const Vector q = hn::Div(hn::Min(ax, ay), larger);
  const Vector q2 = hn::Mul(q, q);
  Vector sum = hn::MulAdd(hn::Set(d, kTurn9), q2, hn::Set(d, kTurn7));
  sum = hn::MulAdd(sum, q2, hn::Set(d, kTurn5));
  sum = hn::MulAdd(sum, q2, hn::Set(d, kTurn3));
  Vector turn = hn::Mul(q, hn::MulAdd(sum, q2, hn::Set(d, kTurn1)));
  turn = hn::IfThenElse(hn::Gt(ay, ax), hn::Sub(hn::Set(d, 0.25F), turn), turn);
  turn = hn::IfThenElse(hn::Lt(x, hn::Zero(d)), hn::Sub(hn::Set(d, 0.5F), turn), turn);
  return hn::IfThenElse(hn::Lt(y, hn::Zero(d)), hn::Sub(hn::Set(d, 1.0F), turn), turn);
}

struct Gradients {
  Vector magnitude, turn;
};

// Of a vector of samples whose neighbour above and to the left is `corner`.
HWY_INLINE Gradients gradients(const float* corner, std::size_t stride) {
  const Floats d;
  const float* row = corner + stride;
  const Vector dx = hn::Sub(hn::LoadU(d, row + 2), hn::LoadU(d, row));
  const Vector dy = hn::Sub(hn::LoadU(d, row + stride + 1), hn::LoadU(d, corner + 1));
  return {hn::Sqrt(hn::MulAdd(dx, dx, hn::Mul(dy, dy))), turns_of(dx, dy)};
}

constexpr std::size_t kLanes = kDescriptorBins;  // room for the last vector of anything

int angles_of(const FixedLevel& level, const PlaceInLevel& place, float* angles) {
  constexpr std::size_t kSide = kOrientationSide;
  constexpr std::size_t kStride = kSide + 2;
  const Floats d;
  HWY_ALIGN float samples[kStride * kStride + 2 * kLanes] = {};
  read_grid(level, orientation_frame(place.x, place.y, place.scale), kStride, kStride, samples);

  // A turn of 1 votes for the bins after the last.
  float votes[kOrientationBins + 2] = {};
  HWY_ALIGN float magnitudes[kSide + kLanes];
  HWY_ALIGN float bins[kSide + kLanes];
  for (std::size_t row = 0; row < kSide; ++row) {
    for (std::size_t column = 0; column < kSide; column += hn::Lanes(d)) {
      const Gradients g = gradients(samples + row * kStride + column, kStride);
      const Vector window = hn::LoadU(d, kTables.orientation_window[row] + column);
      hn::StoreU(hn::Mul(g.magnitude, window), d, magnitudes + column);
      hn::StoreU(hn::Mul(g.turn, hn::Set(d, kOrientationBins)), d, bins + column);
    }
    for (std::size_t column = 0; column < kSide; ++column) {
      const int whole = static_cast<int>(bins[column]);
      const float upper = magnitudes[column] * (bins[column] - static_cast<float>(whole));
      votes[whole] += magnitudes[column] - upper;
      votes[whole + 1] += upper;
    }
  }
  votes[0] += votes[kOrientationBins];
  votes[1] += votes[kOrientationBins + 1];

  float smoothed[kOrientationBins];
  for (int bin = 0; bin < kOrientationBins; ++bin) smoothed[bin] = smoothed_bin(votes, bin);
  const float maximum = *std::max_element(smoothed, smoothed + kOrientationBins);
  int count = 0;
  for (int bin = 0; bin < kOrientationBins && count < kMaxOrientations; ++bin) {
    if (orientation_peak(smoothed, maximum, bin, angles + count)) ++count;
  }
  return count;
}

// Adds one row of samples to the histogram: each sample is shared among the bins, then all samples
// of a cell are summed up, then the cell's sum goes to the one or two cells above each other.
HWY_INLINE void add_row(std::size_t row, const float* HWY_RESTRICT votes,
                        float* HWY_RESTRICT histogram) {
  const Floats d;
  constexpr std::size_t kReach = 2 * kSamplesPerCell;
  const std::size_t lowest = row < kReach ? 0 : row / kSamplesPerCell - 1;
  const std::size_t highest = std::min<std::size_t>(row / kSamplesPerCell, kCells - 1);
  for (std::size_t cell = 0; cell < kCells; ++cell) {
    const float* shares = kTables.cell_share[cell];
    const float* first = votes + cell * kSamplesPerCell * kDescriptorBins;
    for (std::size_t bin = 0; bin < kDescriptorBins; bin += hn::Lanes(d)) {
      Vector even = hn::Zero(d);
      Vector odd = hn::Zero(d);
      for (std::size_t i = 0; i < kReach; i += 2) {
        const float* vote = first + i * kDescriptorBins + bin;
        even = hn::MulAdd(hn::Set(d, shares[i]), hn::Load(d, vote), even);
        odd = hn::MulAdd(hn::Set(d, shares[i + 1]), hn::Load(d, vote + kDescriptorBins), odd);
      }
      const Vector sum = hn::Add(even, odd);
      for (std::size_t above = lowest; above <= highest; ++above) {
        const float share = kTables.cell_share[above][row - above * kSamplesPerCell];
        float* to = histogram + (above * kCells + cell) * kDescriptorBins + bin;
        hn::Store(hn::MulAdd(hn::Set(d, share), sum, hn::Load(d, to)), d, to);
      }
    }
  }
}

HWY_INLINE void to_root_sift(const float* HWY_RESTRICT histogram, std::uint8_t* bytes) {
  const Floats d;
  const hn::Rebind<std::int32_t, Floats> d32;
  const hn::Rebind<std::uint8_t, Floats> d8;
  const std::size_t lanes = hn::Lanes(d);
  Vector squares = hn::Zero(d);
  for (std::size_t i = 0; i < kDescriptorSize; i += lanes) {
    const Vector v = hn::Load(d, histogram + i);
    squares = hn::MulAdd(v, v, squares);
  }
  const Vector largest = hn::Mul(hn::Sqrt(hn::SumOfLanes(d, squares)), hn::Set(d, kClip));
  Vector sums = hn::Zero(d);
  for (std::size_t i = 0; i < kDescriptorSize; i += lanes) {
    sums = hn::Add(sums, hn::Min(hn::Load(d, histogram + i), largest));
  }
  const Vector sum = hn::SumOfLanes(d, sums);
  const auto any = hn::Gt(sum, hn::Zero(d));
  const Vector scale = hn::IfThenElseZero(any, hn::Div(hn::Set(d, kQuantum * kQuantum), sum));
  for (std::size_t i = 0; i < kDescriptorSize; i += lanes) {
    const Vector v = hn::Min(hn::Load(d, histogram + i), largest);
    const Vector root = hn::Add(hn::Sqrt(hn::Mul(v, scale)), hn::Set(d, 0.5F));
    const auto rounded = hn::ConvertTo(d32, hn::Min(root, hn::Set(d, 255.0F)));
    hn::StoreU(hn::DemoteTo(d8, rounded), d8, bytes + i);
  }
}

void descriptor_of(const FixedLevel& level, const PlaceInLevel& place, float angle,
                   std::uint8_t* bytes) {
  constexpr std::size_t kSide = kDescriptorSide;
  constexpr std::size_t kStride = kDescriptorGrid;
  const Floats d;
  HWY_ALIGN float samples[kStride * kStride + 2 * kLanes] = {};
  read_grid(level, descriptor_frame(place.x, place.y, place.scale, angle), kStride, kStride,
            samples);

  HWY_ALIGN float histogram[kDescriptorSize] = {};
  HWY_ALIGN float magnitudes[kSide + kLanes];
  HWY_ALIGN float bins[kSide + kLanes];
  HWY_ALIGN float votes[kSide * kDescriptorBins];
  for (std::size_t row = 0; row < kSide; ++row) {
    for (std::size_t column = 0; column < kSide; column += hn::Lanes(d)) {
      const Gradients g = gradients(samples + row * kStride + column, kStride);
      hn::StoreU(g.magnitude, d, magnitudes + column);
      hn::StoreU(hn::Mul(g.turn, hn::Set(d, kDescriptorBins)), d, bins + column);
    }
    for (std::size_t column = 0; column < kSide; ++column) {
      for (std::size_t bin = 0; bin < kDescriptorBins; bin += hn::Lanes(d)) {
        const Vector here = hn::Iota(d, static_cast<float>(bin));
        const Vector distance = hn::Abs(hn::Sub(hn::Set(d, bins[column]), here));
        const Vector round = hn::Sub(hn::Set(d, kDescriptorBins), distance);
        const Vector share = hn::Sub(hn::Set(d, 1.0F), hn::Min(distance, round));
        const Vector vote = hn::Mul(hn::Max(share, hn::Zero(d)), hn::Set(d, magnitudes[column]));
        hn::Store(vote, d, votes + column * kDescriptorBins + bin);
      }
    }
    add_row(row, votes, histogram);
  }
  to_root_sift(histogram, bytes);
}

}  // namespace HWY_NAMESPACE
}  // namespace hybrid_slam::sift
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hybrid_slam::sift {

HWY_EXPORT(angles_of);
HWY_EXPORT(descriptor_of);

void prefetch_patch(const FixedLevel& level, const PlaceInLevel& place, float reach) {
  constexpr int kCacheLine = 64 / sizeof(std::uint16_t);
  const int steps = static_cast<int>(reach * place.scale) + 1;
  const int x = static_cast<int>(place.x);
  const int y = static_cast<int>(place.y);
  const int last = std::min(x + steps, level.width - 1);
  for (int row = std::max(y - steps, 0); row <= std::min(y + steps, level.height - 1); ++row) {
    const std::uint16_t* samples = level.samples + row * level.stride;
    for (int column = std::max(x - steps, 0); column < last; column += kCacheLine) {
      hwy::Prefetch(samples + column);
    }
    hwy::Prefetch(samples + last);
  }
}

int find_angles(const FixedLevel& level, const PlaceInLevel& place, float* angles) {
  return HWY_DYNAMIC_DISPATCH(angles_of)(level, place, angles);
}

void describe(const FixedLevel& level, const PlaceInLevel& place, float angle,
              std::uint8_t* bytes) {
  HWY_DYNAMIC_DISPATCH(descriptor_of)(level, place, angle, bytes);
}

}  // namespace hybrid_slam::sift
#endif  // HWY_ONCE
