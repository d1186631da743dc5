#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "frontend/features/image.h"

// Images for the programs beside this header, which have no library to read them with.

namespace hybrid_slam::cuda {

// Bright and dark blobs of many sizes, moved by (shift, 0) [px], and some noise.
inline GrayImage made_image(int width, int height, unsigned seed, double shift = 0) {
  std::mt19937 random(seed);
  const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
  const auto size = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  std::vector<double> sums(size, 128);
  for (std::size_t i = 0; i < size / 80; ++i) {
    const double x0 = width * unit() + shift;
    const double y0 = height * unit();
    const double sigma = 1 + 5 * unit() * unit();
    const double amplitude = (unit() < 0.5 ? -1 : 1) * (10 + 40 * unit());
    const int reach = static_cast<int>(3 * sigma) + 1;
    for (int y = std::max(0, static_cast<int>(y0) - reach);
         y < std::min(height, static_cast<int>(y0) + reach); ++y) {
      for (int x = std::max(0, static_cast<int>(x0) - reach);
           x < std::min(width, static_cast<int>(x0) + reach); ++x) {
        const double square = (x - x0) * (x - x0) + (y - y0) * (y - y0);
        sums[static_cast<std::size_t>(y) * width + x] +=
            amplitude * std::exp(-square / (2 * sigma * sigma));
      }
    }
  }
  GrayImage image{width, height, std::vector<std::uint8_t>(size)};
  for (std::size_t i = 0; i < size; ++i) {
    const double value = std::clamp(sums[i] + 4 * unit() - 2, 0.0, 255.0);
    image.pixels[i] = static_cast<std::uint8_t>(value);
  }
  return image;
}

// Binary PGM (P5) of 8 bits. Throws std::runtime_error.
inline GrayImage read_pgm(const std::string& name) {
  std::ifstream file(name, std::ios::binary);
  std::string magic;
  file >> magic;
  int numbers[3] = {};
  for (int& number : numbers) {
    while ((file >> std::ws).peek() == '#') std::getline(file, magic);
    file >> number;
  }
  file.get();
  GrayImage image{numbers[0], numbers[1], {}};
  const bool fits = file && image.width > 0 && image.height > 0 && image.width <= 65535 &&
                    image.height <= 65535 && numbers[2] == 255;
  if (!fits) throw std::runtime_error(name + ": no binary PGM of 8 bits");
  image.pixels.resize(static_cast<std::size_t>(image.width) * image.height);
  file.read(reinterpret_cast<char*>(image.pixels.data()),
            static_cast<std::streamsize>(image.pixels.size()));
  if (!file) throw std::runtime_error(name + ": too short");
  return image;
}

}  // namespace hybrid_slam::cuda
