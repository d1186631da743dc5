#include "frontend/features/cpu/row_store.h"

#include <algorithm>

#include "frontend/features/definition/scale_space.h"

namespace hybrid_slam::sift {
namespace {

std::size_t whole_vectors(int samples) {
  return (static_cast<std::size_t>(samples) + kRowPadding - 1) / kRowPadding * kRowPadding;
}

template <typename Sample>
hwy::AlignedFreeUniquePtr<Sample[]> zeros(std::size_t size) {
  auto samples = hwy::AllocateAligned<Sample>(size);
  std::fill_n(samples.get(), size, Sample{0});
  return samples;
}

}  // namespace

template <typename Sample>
RowStoreOf<Sample>::RowStoreOf(int width, int capacity)
    : capacity_(capacity), stride_(whole_vectors(width) + kRowPadding) {
  // Rows at a multiple of 2 kB would share few lines of the first-level cache.
  if (stride_ * sizeof(Sample) % 2048 == 0) stride_ += kRowPadding;
  samples_ = zeros<Sample>(stride_ * static_cast<std::size_t>(capacity));
}

template class RowStoreOf<float>;
template class RowStoreOf<std::uint16_t>;

PaddedRow::PaddedRow(int width, int reach)
    : width_(width),
      reach_(reach),
      before_(whole_vectors(reach)),
      samples_(zeros<float>(2 * before_ + whole_vectors(width) + kRowPadding)) {}

void PaddedRow::mirror() {
  float* const row = samples();
  for (int i = 1; i <= reach_; ++i) {
    row[-i] = row[mirrored(-i, width_)];
    row[width_ - 1 + i] = row[mirrored(width_ - 1 + i, width_)];
  }
}

}  // namespace hybrid_slam::sift
