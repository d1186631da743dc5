#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace hybrid_slam {

// Divides an image into cells, as square as they go, row by row.
struct ImageCells {
  static constexpr int kColumns = 8;

  int width = 0;  // of the image [px]
  int height = 0;
  int rows = 0;

  ImageCells() = default;
  ImageCells(int image_width, int image_height)
      : width(image_width),
        height(image_height),
        rows(std::max(1, static_cast<int>(std::lround(static_cast<double>(kColumns) * height /
                                                      std::max(1, width))))) {}

  std::size_t size() const {
    return static_cast<std::size_t>(kColumns) * static_cast<std::size_t>(rows);
  }

  // Of a pixel; of one outside, the nearest.
  std::size_t of(double x, double y) const {
    const auto place = [](double at, int length, int cells) {
      return std::clamp(static_cast<int>((at + 0.5) / length * cells), 0, cells - 1);
    };
    const int cell = place(y, height, rows) * kColumns + place(x, width, kColumns);
    return static_cast<std::size_t>(cell);
  }

  double center_x(std::size_t cell) const {
    return (static_cast<double>(cell % kColumns) + 0.5) * width / kColumns - 0.5;
  }
  double center_y(std::size_t cell) const {
    const std::size_t row = cell / kColumns;
    return (static_cast<double>(row) + 0.5) * height / rows - 0.5;
  }
};

// Number, mean and mean square of values.
struct Moments {
  double count = 0;
  double sum = 0;
  double squares = 0;

  void add(double value) {
    ++count;
    sum += value;
    squares += value * value;
  }
  Moments operator+(const Moments& other) const {
    return {count + other.count, sum + other.sum, squares + other.squares};
  }
  double mean() const { return count > 0 ? sum / count : 0; }
  double variance() const {  // around the mean
    return count > 1 ? std::max(0.0, squares - sum * sum / count) / (count - 1) : 0;
  }
};

}  // namespace hybrid_slam
