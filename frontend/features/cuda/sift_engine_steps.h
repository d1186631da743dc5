#pragma once

// Part of sift_engine.h: what is run.

namespace hybrid_slam::cuda {

template <typename Backend>
void SiftEngine<Backend>::start(const GrayImage& image, const GrayImage* mask) {
  check_sizes(image, mask);
  prepare(image.width, image.height, mask != nullptr);
  if (octaves_of(width_, height_) == 0) return;
  const std::size_t size = image.pixels.size();
  backend_.wait();  // for an upload from the same memory
  std::memcpy(host_pixels_, image.pixels.data(), size);
  if (mask != nullptr) std::memcpy(host_pixels_ + size, mask->pixels.data(), size);
  run();
}

template <typename Backend>
FeatureSet SiftEngine<Backend>::finish() {
  FeatureSet set;
  set.kind = DescriptorKind::kRootSift;
  if (octaves_of(width_, height_) == 0) return set;
  backend_.wait();
  const Results results = results_at(host_results_);
  if (results.counts[0] > extrema_capacity_) {
    extrema_capacity_ = results.counts[0] + results.counts[0] / 4;
    const std::size_t size = static_cast<std::size_t>(width_) * height_ * (masked_ ? 2 : 1);
    const std::vector<std::uint8_t> pixels(host_pixels_, host_pixels_ + size);
    allocate();
    std::memcpy(host_pixels_, pixels.data(), size);
    run();
    return finish();
  }
  const auto count = static_cast<std::size_t>(results.counts[1]);
  set.keypoints.assign(results.keypoints, results.keypoints + count);
  for (Keypoint& keypoint : set.keypoints) keypoint.sigma = options_.position_sigma(keypoint.scale);
  set.descriptors.resize(count);
  std::memcpy(set.descriptors.data(), results.descriptors, count * sift::kDescriptorSize);
  return set;
}

template <typename Backend>
void SiftEngine<Backend>::run() {
  const std::size_t size = static_cast<std::size_t>(width_) * height_;
  backend_.begin_stage("upload");
  backend_.upload(pixels_, host_pixels_, masked_ ? 2 * size : size);
  backend_.record([&] {
    backend_.begin_stage("scale space");
    make_scale_space();
    backend_.begin_stage("extrema");
    find_extrema();
    backend_.begin_stage("selection");
    spread(sorting_.spread, kGridBlocks);
    backend_.launch({kGridBlocks}, GatherExtrema{sorting_, selected_});
    make_features();
  });
  backend_.begin_stage("download");
  backend_.download(host_results_, results_.counts, results_.bytes);
  backend_.begin_stage(nullptr);
}

template <typename Backend>
void SiftEngine<Backend>::make_scale_space() {
  const auto blur = [&](const Source& in, const Size& size, std::size_t first, std::size_t count,
                        float* out) {
    Kernels kernels{};
    for (std::size_t k = 0; k < count; ++k) kernels.reach[k] = reach_of(kernels_[first + k]);
    kernels.weights = weights_ + first * kMaxTaps;
    const auto grid = [&](int columns, int rows) {
      return Grid{(size.width + columns - 1) / columns, (size.height + rows - 1) / rows,
                  static_cast<int>(count)};
    };
    backend_.launch(grid(BlurRows::kColumns, BlurRows::kRows),
                    BlurRows{in, size, kernels, blurred_});
    backend_.launch(grid(BlurColumns::kColumns, BlurColumns::kRows),
                    BlurColumns{blurred_, size, kernels, out});
  };
  const std::size_t levels = kernels_.size() - 1;
  const Source image{pixels_, nullptr, width_, 1, options_.upsample};
  blur(image, scale_space_.octave[0].size, levels, 1, first_level_);
  for (int number = 0; number < scale_space_.octaves; ++number) {
    const Octave& octave = scale_space_.octave[number];
    blur(octave.first, octave.size, 0, levels, octave.levels);
  }
}

template <typename Backend>
void SiftEngine<Backend>::find_extrema() {
  backend_.clear(cleared_, cleared_bytes_);
  backend_.clear(results_.counts, 2 * sizeof(int));
  const std::uint8_t* mask =
      masked_ ? pixels_ + static_cast<std::size_t>(width_) * height_ : nullptr;
  backend_.launch({tiles_}, FindExtrema{scale_space_, static_cast<float>(options_.initial_sigma),
                                        static_cast<float>(options_.contrast_threshold),
                                        static_cast<float>(options_.edge_threshold), mask, width_,
                                        height_, claimed_, sorting_.found});
  backend_.launch({1}, PlaceBuckets{sorting_});
  backend_.launch({kGridBlocks}, FillBuckets{sorting_});
  backend_.launch({kGridBlocks}, SortBuckets{sorting_});
}

template <typename Backend>
void SiftEngine<Backend>::spread(const Spread& spread, int blocks) {
  backend_.launch({1}, FindQuota{spread});
  backend_.launch({blocks}, ListMembers{spread});
  backend_.launch({blocks}, KeepItems{spread});
  backend_.launch({1}, CountKept{spread});
}

template <typename Backend>
void SiftEngine<Backend>::make_features() {
  const Spread& selection = sorting_.spread;
  backend_.begin_stage("orientation");
  backend_.launch({options_.max_features},
                  FindAngles{scale_space_, selection, selected_, angles_, angle_counts_});
  backend_.launch({1}, PlaceAngles{selection, angle_counts_, angle_firsts_, oriented_count_});
  backend_.launch({grid_blocks_}, ListAngles{selection, selected_, angles_, angle_counts_,
                                             angle_firsts_, oriented_, oriented_spread_});
  spread(oriented_spread_, grid_blocks_);
  backend_.launch({grid_blocks_}, GatherOriented{oriented_spread_, oriented_, oriented_selected_,
                                                 &results_.counts[1]});
  backend_.begin_stage("descriptors");
  backend_.launch({options_.max_features},
                  Describe{scale_space_, &results_.counts[1], selected_, oriented_selected_,
                           results_.keypoints, results_.descriptors});
}

}  // namespace hybrid_slam::cuda
