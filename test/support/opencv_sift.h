#pragma once

#include <memory>

#include "frontend/features/sift.h"

namespace hybrid_slam {

// OpenCV's SIFT behind our interface, with the same options, selection and descriptors: the
// reference that ours is compared with. Throws std::invalid_argument if the options are not valid.
std::unique_ptr<SiftExtractor> make_opencv_sift(const SiftOptions& options);

}  // namespace hybrid_slam
