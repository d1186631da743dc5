#pragma once

// Part of sift_engine.h: what is allocated.

namespace hybrid_slam::cuda {

template <typename Backend>
int SiftEngine<Backend>::octaves_of(int width, int height) const {
  if (std::min(width, height) < sift::kMinOctaveSize) return 0;
  int octaves = 0;
  for (int index = options_.upsample ? -1 : 0; octaves < kMaxOctaves; ++index, ++octaves) {
    const int side = std::min(sift::octave_size(width, index), sift::octave_size(height, index));
    if (side < sift::kMinOctaveSize) break;
  }
  return octaves;
}

template <typename Backend>
void SiftEngine<Backend>::prepare(int width, int height, bool masked) {
  if (allocated_ && width == width_ && height == height_) {
    if (masked == masked_) return;
    masked_ = masked;
    backend_.forget();
    return;
  }
  width_ = width;
  height_ = height;
  masked_ = masked;
  // Blobs cannot be much closer to one another than the blur that they are found with.
  const double samples = static_cast<double>(width) * height * (options_.upsample ? 4 : 1);
  extrema_capacity_ = static_cast<int>(samples / 24) + 1024;
  allocate();
}

template <typename Backend>
void SiftEngine<Backend>::allocate() {
  allocated_ = false;  // and so it stays if there is too little memory
  backend_.release();
  if (octaves_of(width_, height_) == 0) return;
  const std::size_t pixels = static_cast<std::size_t>(width_) * height_;
  host_pixels_ = static_cast<std::uint8_t*>(backend_.allocate_for_host(2 * pixels));
  pixels_ = take<std::uint8_t>(2 * pixels);
  weights_ = take<float>(padded_weights_.size());
  backend_.upload_now(weights_, padded_weights_.data(), padded_weights_.size() * sizeof(float));
  allocate_scale_space();
  allocate_results();
  allocated_ = true;
}

template <typename Backend>
void SiftEngine<Backend>::allocate_scale_space() {
  const int levels = options_.octave_layers + 2;
  scale_space_ = {};
  scale_space_.layers = options_.octave_layers;
  scale_space_.octaves = octaves_of(width_, height_);
  std::size_t samples = 0;
  tiles_ = 0;
  for (int number = 0; number < scale_space_.octaves; ++number) {
    const int index = options_.upsample ? number - 1 : number;
    Octave& octave = scale_space_.octave[number];
    Size& size = octave.size;
    size.width = sift::octave_size(width_, index);
    size.height = sift::octave_size(height_, index);
    size.stride = (size.width + 31) / 32 * 32;
    size.plane = static_cast<std::size_t>(size.stride) * static_cast<std::size_t>(size.height);
    octave.pixels = std::exp2(static_cast<float>(index));
    octave.levels = take<float>(static_cast<std::size_t>(levels) * size.plane);
    if (number == 0) {
      blurred_ = take<float>(static_cast<std::size_t>(levels) * size.plane);
      first_level_ = take<float>(size.plane);
      octave.first = {nullptr, first_level_, size.stride, 1, false};
    } else {
      const Octave& finer = scale_space_.octave[number - 1];
      const float* doubled = finer.level(scale_space_.layers).samples;
      octave.first = {nullptr, doubled, 2 * finer.size.stride, 2, false};
    }
    const int inner_width = size.width - 2 * sift::kBorder;
    const int inner_height = size.height - 2 * sift::kBorder;
    octave.first_tile = tiles_;
    octave.tiles_across = (inner_width + FindExtrema::kColumns - 1) / FindExtrema::kColumns;
    tiles_ += octave.tiles_across * ((inner_height + FindExtrema::kRows - 1) / FindExtrema::kRows);
    octave.samples = samples;
    samples += static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height) *
               static_cast<std::size_t>(scale_space_.layers);
  }
}

template <typename Backend>
void SiftEngine<Backend>::allocate_results() {
  const int max_count = options_.max_features;
  const int oriented = max_count * sift::kMaxOrientations;
  const Octave& last = scale_space_.octave[scale_space_.octaves - 1];
  const std::size_t samples = last.samples + static_cast<std::size_t>(scale_space_.layers) *
                                                 static_cast<std::size_t>(last.size.width) *
                                                 static_cast<std::size_t>(last.size.height);
  const auto capacity = static_cast<std::size_t>(extrema_capacity_);
  const auto most = static_cast<std::size_t>(max_count);

  const std::size_t cells =
      static_cast<std::size_t>(make_spread_grid(width_, height_, max_count).cells());
  cleared_bytes_ = sizeof(int) * (2 * kBuckets + 2 * 3 * cells + samples / 32 + 1 + capacity / 32 +
                                  1 + most * sift::kMaxOrientations / 32 + 1);
  int* cleared = take<int>(cleared_bytes_ / sizeof(int));
  cleared_ = cleared;
  const auto carve = [&](std::size_t count) {
    int* const part = cleared;
    cleared += count;
    return part;
  };

  results_ = results_at(nullptr);
  host_results_ = backend_.allocate_for_host(results_.bytes);
  results_ = results_at(backend_.allocate(results_.bytes));

  sorting_ = {};
  sorting_.found = {&results_.counts[0], extrema_capacity_, take<Extremum>(capacity),
                    carve(kBuckets)};
  sorting_.cursors = carve(kBuckets);
  claimed_ = reinterpret_cast<unsigned*>(carve(samples / 32 + 1));
  sorting_.bucket_firsts = take<int>(kBuckets);
  sorting_.bucketed = take<Extremum>(capacity);
  sorting_.sorted = take<Extremum>(capacity);
  sorting_.count = take<int>(1);
  sorting_.spread = make_spread(extrema_capacity_, sorting_.count, cleared);

  selected_ = take<Extremum>(most);
  angles_ = take<float>(most * sift::kMaxOrientations);
  angle_counts_ = take<int>(most);
  angle_firsts_ = take<int>(most);
  oriented_count_ = take<int>(1);
  oriented_ = take<Oriented>(most * sift::kMaxOrientations);
  oriented_selected_ = take<Oriented>(most);
  oriented_spread_ = make_spread(oriented, oriented_count_, cleared);
}

template <typename Backend>
Spread SiftEngine<Backend>::make_spread(int capacity, const int* count, int*& cleared) {
  Spread spread{};
  spread.grid = make_spread_grid(width_, height_, options_.max_features);
  spread.max_count = options_.max_features;
  spread.strongest = strongest_count(options_.max_features);
  spread.count = count;
  const int cells = spread.grid.cells();
  const int words = capacity / 32 + 1;
  spread.cell_sizes = cleared;
  spread.taken = spread.cell_sizes + cells;
  spread.cursors = spread.taken + cells;
  spread.kept = reinterpret_cast<unsigned*>(spread.cursors + cells);
  cleared = spread.cursors + cells + words;
  spread.cell_firsts = take<int>(static_cast<std::size_t>(cells));
  spread.cells = take<int>(static_cast<std::size_t>(capacity));
  spread.members = take<int>(static_cast<std::size_t>(capacity));
  spread.kept_before = take<int>(static_cast<std::size_t>(words));
  spread.quota = take<int>(1);
  spread.kept_count = take<int>(1);
  return spread;
}

template <typename Backend>
auto SiftEngine<Backend>::results_at(void* memory) const -> Results {
  constexpr std::size_t kHead = 64;
  const auto count = static_cast<std::size_t>(options_.max_features);
  auto* const bytes = static_cast<std::uint8_t*>(memory);
  const std::size_t keypoints = count * sizeof(Keypoint);
  Results results{};
  results.bytes = kHead + keypoints + count * sift::kDescriptorSize;
  if (memory == nullptr) return results;
  results.counts = reinterpret_cast<int*>(bytes);
  results.keypoints = reinterpret_cast<Keypoint*>(bytes + kHead);
  results.descriptors = bytes + kHead + keypoints;
  return results;
}

}  // namespace hybrid_slam::cuda
