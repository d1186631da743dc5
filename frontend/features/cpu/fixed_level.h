#pragma once

#include <cstdint>

#include "frontend/features/definition/patch.h"

namespace hybrid_slam::sift {

// A level as it is kept for descriptors: in 16 bits, so that two samples side by side are read at
// once.
using FixedLevel = LevelOf<std::uint16_t>;

}  // namespace hybrid_slam::sift
