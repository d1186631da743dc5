#include "frontend/features/image_quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

namespace hybrid_slam {
namespace {

constexpr int kStep = 8;         // every so many rows, or columns, are looked at
constexpr int kRadius = 4;       // of the box that blurs
constexpr int kSaturated = 250;  // [grey levels]

// Sums along one row or column: of the differences of neighbours, and of what blurring takes away.
class BlurEffect {
 public:
  // `stride`: from a pixel to the next.
  void add_line(const std::uint8_t* first, std::ptrdiff_t stride, int count) {
    const auto at = [&](int i) { return static_cast<int>(first[i * stride]); };
    int box = 0;  // of the 2 kRadius + 1 pixels around i
    for (int i = 0; i <= 2 * kRadius && i < count; ++i) box += at(i);
    for (int i = kRadius + 1; i + kRadius < count; ++i) {
      const int next_box = box + at(i + kRadius) - at(i - kRadius - 1);
      const int sharp = (2 * kRadius + 1) * std::abs(at(i) - at(i - 1));
      differences_ += sharp;
      lost_ += std::max(0, sharp - std::abs(next_box - box));
      box = next_box;
    }
  }

  double blur() const {
    if (differences_ == 0) return 1;  // nothing is to be seen
    return static_cast<double>(differences_ - lost_) / static_cast<double>(differences_);
  }

 private:
  std::int64_t differences_ = 0;
  std::int64_t lost_ = 0;
};

double blur_of(const GrayImage& image) {
  BlurEffect rows;
  BlurEffect columns;
  for (int y = 0; y < image.height; y += kStep) rows.add_line(image.row(y), 1, image.width);
  for (int x = 0; x < image.width; x += kStep) {
    columns.add_line(image.pixels.data() + x, image.width, image.height);
  }
  return std::max(rows.blur(), columns.blur());
}

}  // namespace

ImageQuality image_quality(const GrayImage& image) {
  ImageQuality quality;
  if (image.empty()) return quality;
  std::array<int, 256> histogram{};
  quality.signature = 14695981039346656037ULL;  // FNV-1a
  for (int y = 0; y < image.height; y += kStep) {
    const std::uint8_t* const row = image.row(y);
    for (int x = 0; x < image.width; ++x) {
      ++histogram[row[x]];
      quality.signature = (quality.signature ^ row[x]) * 1099511628211ULL;
    }
  }
  int total = 0;
  for (const int count : histogram) total += count;
  int below = 0;
  int level = 0;
  while (level < 255 && below + histogram[static_cast<std::size_t>(level)] < 0.99 * total) {
    below += histogram[static_cast<std::size_t>(level++)];
  }
  quality.brightest = level;
  int saturated = 0;
  for (std::size_t i = kSaturated; i < histogram.size(); ++i) saturated += histogram[i];
  quality.saturated = static_cast<double>(saturated) / total;
  quality.blur = blur_of(image);
  return quality;
}

double masked_share(const GrayImage& mask) {
  if (mask.empty()) return 0;
  return static_cast<double>(std::count(mask.pixels.begin(), mask.pixels.end(), 0)) /
         static_cast<double>(mask.pixels.size());
}

}  // namespace hybrid_slam
