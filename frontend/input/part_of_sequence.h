#pragma once

#include <cstddef>
#include <memory>

#include "frontend/input/image_sequence.h"

namespace hybrid_slam {

// Every `every`-th frame of a sequence, from frame `start` on, counted from 0; at most `limit`, all
// if that is 0. The truth stays whole. Throws InputError, naming the sequence, if there is no such
// frame; std::logic_error if `every` is 0.
std::unique_ptr<ImageSequence> part_of_sequence(std::unique_ptr<ImageSequence> sequence,
                                                std::size_t start, std::size_t every,
                                                std::size_t limit = 0);

}  // namespace hybrid_slam
