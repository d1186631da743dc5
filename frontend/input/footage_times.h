#pragma once

#include <string>
#include <vector>

#include "frontend/input/footage_images.h"

namespace hybrid_slam {

// Times of left images [s], strictly ascending, by a file: one time per line; dates as in KITTI's
// raw data; or a time and the name of the image, in either order. `left` has one path per frame,
// some of which may be empty, and `numbers` the frames' numbers. Throws InputError.
std::vector<double> times_by_file(const std::string& path,
                                  const std::vector<std::filesystem::path>& left,
                                  const std::vector<std::int64_t>& numbers,
                                  std::vector<std::string>& warnings);

}  // namespace hybrid_slam
