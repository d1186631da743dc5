#pragma once

#include <cstdint>

// Random numbers of sensors, each a function of hashed bits alone.
namespace hybrid_slam {

// Gaussian, mean 0, standard deviation 1 (Box and Muller 1958).
float gaussian(std::uint32_t bits);

// A Poisson number: by inversion of the distribution for means up to 50; above, where the
// Gaussian's third moment is off by less than 1 / sqrt(50), a rounded Gaussian.
float poisson(float mean, std::uint32_t bits);

}  // namespace hybrid_slam
