#include "frontend/features/cpu/scale_space.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "frontend/features/key_sort.h"

namespace hybrid_slam::sift {
namespace {

// Rows above and below an extremum that its refinement may read.
constexpr int kSearchReach = kMaxMoves + 1;

constexpr int kBlock = kBlockRows;

int whole_blocks(int rows) { return (rows + kBlock - 1) / kBlock * kBlock; }

void halve(const float* row, int half_width, float* out) {
  for (int x = 0; x < half_width; ++x, row += 2) out[x] = *row;
}

// Ascending by layer, row and column.
std::uint64_t place(const RefinedExtremum& e) {
  const auto bits = [](int number) { return static_cast<std::uint64_t>(number); };
  return bits(e.layer) << 56 | bits(e.y) << 28 | bits(e.x);
}

}  // namespace

ScaleSpace::ScaleSpace(const SiftOptions& options)
    : layers_(options.octave_layers),
      upsample_(options.upsample),
      initial_sigma_(options.initial_sigma),
      contrast_threshold_(static_cast<float>(options.contrast_threshold)),
      edge_threshold_(static_cast<float>(options.edge_threshold)) {
  lags_.push_back(0);
  for (int level = 1; level < layers_ + 3; ++level) {
    kernels_.emplace_back(level_step_sigma(initial_sigma_, layers_, level), KernelCentre::kSample);
    lags_.push_back(lags_.back() + whole_blocks(kernels_.back().reach()));
  }
  search_lag_ = lags_.back() + whole_blocks(kSearchReach);
  pointers_.resize(std::max(kernels_.back().weights.size() + kBlockRows - 1,
                            3 * static_cast<std::size_t>(layers_ + 2)));
  smallest_.resize(static_cast<std::size_t>(layers_));
  largest_.resize(smallest_.size());
}

ScaleSpace::Octave ScaleSpace::make_octave(int index) const {
  const int width = octave_size(width_, index);
  const int height = octave_size(height_, index);
  Octave octave{index, width, height, {}, {}, {}, {}};
  const int levels = layers_ + 3;
  for (int k = 0; k < levels; ++k) {
    const bool from_image = k == 0 && index == (upsample_ ? -1 : 0);
    int rows = kBlock;
    if (k + 1 < levels) {
      const std::size_t above = static_cast<std::size_t>(k) + 1;
      rows += lags_[above] - lags_[above - 1] + kernels_[above - 1].reach();
    }
    const bool all = k == 0 && !from_image;
    octave.levels.emplace_back(width, all ? height : std::min(rows, height));
    if (k >= 1 && k <= layers_) octave.whole.emplace_back(width, height);
  }
  for (std::size_t k = 1; k < octave.levels.size(); ++k) {
    const int rows = search_lag_ - lags_[k] + kSearchReach + kBlock;
    octave.differences.emplace_back(width, std::min(rows, height));
  }
  for (int i = 0; i < kBlock; ++i) octave.blurred.emplace_back(width, kernels_.back().reach());
  return octave;
}

void ScaleSpace::prepare(int width, int height) {
  if (width == width_ && height == height_) return;
  width_ = width;
  height_ = height;
  octaves_.clear();
  first_level_.emplace(initial_sigma_, upsample_, width, height);
  for (int index = upsample_ ? -1 : 0;; ++index) {
    const int side = std::min(octave_size(width, index), octave_size(height, index));
    if (side < kMinOctaveSize) break;
    octaves_.push_back(make_octave(index));
  }
  if (octaves_.empty()) return;
  columns_.resize(static_cast<std::size_t>(octaves_.front().width));
  ranges_.emplace(octaves_.front().width, 2 * layers_);
  for (int layer = 0; layer < layers_; ++layer) {
    smallest_[static_cast<std::size_t>(layer)] = ranges_->row(2 * layer);
    largest_[static_cast<std::size_t>(layer)] = ranges_->row(2 * layer + 1);
  }
}

const std::vector<Extremum>& ScaleSpace::detect(const GrayImage& image) {
  extrema_.clear();
  if (std::min(image.width, image.height) < kMinOctaveSize) return extrema_;
  prepare(image.width, image.height);
  for (std::size_t octave = 0; octave < octaves_.size(); ++octave) pass(image, octave);
  return extrema_;
}

FixedLevel ScaleSpace::level(int octave, int level) const {
  const Octave& of = octaves_.at(static_cast<std::size_t>(octave));
  const FixedRowStore& rows = of.whole.at(static_cast<std::size_t>(level - 1));
  return {rows.row(0), static_cast<long>(rows.stride()), of.width, of.height};
}

void ScaleSpace::pass(const GrayImage& image, std::size_t number) {
  Octave& octave = octaves_[number];
  Octave* const next = number + 1 < octaves_.size() ? &octaves_[number + 1] : nullptr;
  refined_.clear();
  for (int time = 0; time < octave.height + search_lag_; time += kBlock) {
    const auto end = [&](int y) { return std::min(y + kBlock, octave.height); };
    for (int y = time; number == 0 && y < end(time); ++y) {
      first_level_->make_row(image, y, octave.levels[0].row(y));
    }
    for (std::size_t level = 1; level < octave.levels.size(); ++level) {
      const int first = time - lags_[level];
      if (first < 0 || first >= octave.height) continue;
      make_level_rows(octave, level, first, end(first) - first);
      if (next == nullptr || level != static_cast<std::size_t>(layers_)) continue;
      for (int y = first; y < end(first); y += 2) {
        halve(octave.levels[level].row(y), next->width, next->levels[0].row(y / 2));
      }
    }
    const int first = std::max(time - search_lag_, kBorder);
    for (int y = first; y < std::min(end(time - search_lag_), octave.height - kBorder); ++y) {
      search_row(octave, y);
    }
  }
  collect(octave, static_cast<int>(number));
}

void ScaleSpace::make_level_rows(Octave& octave, std::size_t level, int y, int count) {
  const Kernel& kernel = kernels_[level - 1];
  const RowStore& below = octave.levels[level - 1];
  const auto width = static_cast<std::size_t>(octave.width);
  for (int i = 0; i < kernel.size() + kBlock - 1; ++i) {
    const int row = mirrored(y + i - kernel.reach(), octave.height);
    pointers_[static_cast<std::size_t>(i)] = below.row(row);
  }
  float* blurred[kBlockRows];
  for (std::size_t i = 0; i < kBlockRows; ++i) blurred[i] = octave.blurred[i].samples();
  sum_columns(pointers_.data(), kernel.weights.size(), kernel.weights.data(), width, blurred);
  for (int row = y; row < y + count; ++row) {
    PaddedRow& along_columns = octave.blurred[static_cast<std::size_t>(row - y)];
    along_columns.mirror();
    symmetric_sum_and_difference(along_columns.samples() - kernel.reach(), kernel.weights.size(),
                                 kernel.weights.data(), width, octave.levels[level].row(row),
                                 below.row(row), octave.differences[level - 1].row(row));
    if (level > octave.whole.size()) continue;
    to_fixed_point(octave.levels[level].row(row), width, octave.whole[level - 1].row(row));
  }
}

void ScaleSpace::search_row(const Octave& octave, int y) {
  const auto rows_at = [&](int layer, int row, int column, const float** rows) {
    for (int i = 0; i < 9; ++i) {
      const auto k = static_cast<std::size_t>(layer + i / 3 - 1);
      rows[i] = octave.differences[k].row(row + i % 3 - 1) + column;
    }
  };
  const ExtremumLimits limits{layers_, octave.height, octave.width, contrast_threshold_,
                              edge_threshold_};
  const auto layers = static_cast<std::size_t>(layers_);
  for (std::size_t k = 0; k < octave.differences.size(); ++k) {
    for (int i = 0; i < 3; ++i) {
      pointers_[3 * k + static_cast<std::size_t>(i)] = octave.differences[k].row(y + i - 1);
    }
  }
  column_ranges(pointers_.data(), layers, static_cast<std::size_t>(octave.width), smallest_.data(),
                largest_.data());
  for (std::size_t layer = 0; layer < layers; ++layer) {
    const std::size_t count =
        find_extrema(pointers_.data() + 3 * layer, smallest_[layer], largest_[layer], kBorder,
                     static_cast<std::size_t>(octave.width - kBorder),
                     kSampleContrast * contrast_threshold_, columns_.data());
    for (std::size_t i = 0; i < count; ++i) {
      RefinedExtremum refined;
      if (!refine_extremum(rows_at, limits, static_cast<int>(layer) + 1, y, columns_[i],
                           &refined)) {
        continue;
      }
      refined_.push_back(refined);
    }
  }
}

// Two samples whose refinement ends at the same one are the same extremum.
void ScaleSpace::collect(const Octave& octave, int number) {
  std::vector<Keyed> places;
  places.reserve(refined_.size());
  for (const RefinedExtremum& r : refined_) {
    places.push_back({place(r), static_cast<std::uint32_t>(places.size())});
  }
  sort_by_key(places);
  const auto same = [](const Keyed& a, const Keyed& b) { return a.key == b.key; };
  places.erase(std::unique(places.begin(), places.end(), same), places.end());
  const float pixels = std::exp2(static_cast<float>(octave.index));
  for (const Keyed& at : places) {
    const RefinedExtremum& r = refined_[at.index];
    const float layer = static_cast<float>(r.layer) + r.to_layer;
    Extremum extremum;
    extremum.octave = number;
    extremum.level = std::clamp(static_cast<int>(std::lround(layer)), 1, layers_);
    extremum.level_x = static_cast<float>(r.x) + r.to_x;
    extremum.level_y = static_cast<float>(r.y) + r.to_y;
    extremum.level_scale = level_sigma(static_cast<float>(initial_sigma_), layers_, layer);
    extremum.x = extremum.level_x * pixels;
    extremum.y = extremum.level_y * pixels;
    extremum.scale = extremum.level_scale * pixels;
    extremum.response = r.response;
    extrema_.push_back(extremum);
  }
}

}  // namespace hybrid_slam::sift
