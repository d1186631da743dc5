#pragma once

#include <memory>

#include "frontend/features/sift.h"

namespace hybrid_slam {

// OpenCV's SIFT behind our interface, with the same options, selection and descriptors: the
// reference that ours is compared with. It forms the scale space for the detection, and once more
// for the descriptors of what was selected, so that it takes longer than OpenCV's
// detectAndCompute() with its own selection. Throws std::invalid_argument if the options are not
// valid.
std::unique_ptr<SiftExtractor> make_opencv_sift(const SiftOptions& options);

}  // namespace hybrid_slam
