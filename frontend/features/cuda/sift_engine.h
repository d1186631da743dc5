#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "frontend/features/cuda/blur_weights.h"
#include "frontend/features/cuda/extremum_kernels.h"
#include "frontend/features/cuda/order_kernels.h"
#include "frontend/features/cuda/patch_kernels.h"
#include "frontend/features/cuda/scale_space.h"
#include "frontend/features/cuda/selection_kernels.h"
#include "frontend/features/image.h"
#include "frontend/features/sift.h"

namespace hybrid_slam::cuda {

// Features on the device.
struct FeaturesView {
  const int* count;
  int capacity;
  const Keypoint* keypoints;        // without sigma
  const std::uint8_t* descriptors;  // sift::kDescriptorSize each
};

// Blocks of kernels that share out a number of items that only the device knows.
constexpr int kGridBlocks = 128;

// All of SIFT as a sequence of kernels on a backend (on_host.h, on_device.h). Memory is allocated
// when the size of the image changes, and in the rare case that an image has more extrema than
// there is room for; then it is searched once more.
template <typename Backend>
class SiftEngine {
 public:
  // Throws std::invalid_argument if the options are not valid or a blur is too large.
  template <typename... BackendArguments>
  explicit SiftEngine(const SiftOptions& options, BackendArguments&&... arguments)
      : backend_(std::forward<BackendArguments>(arguments)...),
        options_(checked(options)),
        grid_blocks_((options.max_features + 255) / 256) {
    if (const std::string why = why_blurs_too_large(options_); !why.empty()) {
      throw std::invalid_argument("SIFT options: " + why);
    }
    kernels_ = all_weights(options_);
    padded_weights_ = padded_weights(kernels_);
  }

  // Enqueues all work for an image, which may change as soon as this returns.
  void start(const GrayImage& image, const GrayImage* mask);

  // Waits for what was started last.
  FeatureSet finish();

  // Of the image last started; valid until the next start(). Null pointers if it is too small.
  FeaturesView features() const {
    if (octaves_of(width_, height_) == 0) return {nullptr, 0, nullptr, nullptr};
    return {&results_.counts[1], options_.max_features, results_.keypoints, results_.descriptors};
  }
  // After finish().
  int finished_count() const {
    return octaves_of(width_, height_) == 0 ? 0 : results_at(host_results_).counts[1];
  }
  const ScaleSpace& scale_space() const { return scale_space_; }
  Backend& backend() { return backend_; }

 private:
  // What comes back, in one piece.
  struct Results {
    int* counts;  // extrema found, features
    Keypoint* keypoints;
    std::uint8_t* descriptors;
    std::size_t bytes;
  };

  int octaves_of(int width, int height) const;
  void prepare(int width, int height, bool masked);
  void allocate();
  void allocate_scale_space();
  void allocate_results();
  Spread make_spread(int capacity, const int* count, int*& cleared);
  template <typename T>
  T* take(std::size_t count) {
    return static_cast<T*>(backend_.allocate(count * sizeof(T)));
  }
  Results results_at(void* memory) const;

  void run();
  void make_scale_space();
  void find_extrema();
  void spread(const Spread& spread, int blocks);
  void make_features();

  Backend backend_;
  SiftOptions options_;
  int grid_blocks_;                           // for as many threads as there may be features
  std::vector<std::vector<double>> kernels_;  // of the levels, then of the first level
  std::vector<float> padded_weights_;

  int width_ = 0;  // of the image
  int height_ = 0;
  bool masked_ = false;
  bool allocated_ = false;
  int extrema_capacity_ = 0;

  std::uint8_t* host_pixels_ = nullptr;  // of the image, then of the mask
  std::uint8_t* pixels_ = nullptr;
  float* weights_ = nullptr;
  float* first_level_ = nullptr;
  float* blurred_ = nullptr;  // along the rows
  ScaleSpace scale_space_{};
  int tiles_ = 0;
  void* cleared_ = nullptr;
  std::size_t cleared_bytes_ = 0;
  unsigned* claimed_ = nullptr;
  Sorting sorting_{};
  Extremum* selected_ = nullptr;
  float* angles_ = nullptr;
  int* angle_counts_ = nullptr;
  int* angle_firsts_ = nullptr;
  int* oriented_count_ = nullptr;
  Oriented* oriented_ = nullptr;
  Oriented* oriented_selected_ = nullptr;
  Spread oriented_spread_{};
  Results results_{};
  void* host_results_ = nullptr;
};

}  // namespace hybrid_slam::cuda

#include "frontend/features/cuda/sift_engine_memory.h"
#include "frontend/features/cuda/sift_engine_steps.h"
