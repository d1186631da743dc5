#include "apps/io/picture_file.h"

#include <stdexcept>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "cameras/output_file.h"

namespace hybrid_slam {

void write_picture(const std::filesystem::path& path, const cv::Mat& picture) {
  std::vector<uchar> bytes;
  if (!cv::imencode(".png", picture, bytes)) throw std::logic_error("the picture is not encoded");
  write_file(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace hybrid_slam
