#pragma once

#include <cstdint>
#include <random>

#include "backend/map/features.h"

namespace hybrid_slam {

// Bytes without any structure.
inline Descriptor random_descriptor(std::mt19937_64& random, unsigned max_byte = 255) {
  Descriptor descriptor;
  for (std::uint8_t& byte : descriptor) byte = static_cast<std::uint8_t>(random() % (max_byte + 1));
  return descriptor;
}

inline double random_unit(std::mt19937_64& random) {
  return static_cast<double>(random() >> 11) * 0x1p-53;
}

}  // namespace hybrid_slam
