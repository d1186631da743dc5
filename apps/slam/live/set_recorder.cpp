#include "apps/slam/live/set_recorder.h"

#include <fmt/format.h>

#include <utility>

#include <opencv2/core.hpp>

#include "apps/io/picture_file.h"
#include "cameras/files/output_file.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

SetRecorder::SetRecorder(fs::path folder, const std::vector<std::string>& calibration, bool fisheye)
    : folder_(std::move(folder)) {
  for (const LiveCamera camera : kAllLiveCameras) {
    if (camera == LiveCamera::kFisheye && !fisheye) continue;
    const fs::path images = make_folder(folder_ / to_string(camera));
    if (!fs::is_empty(images)) {
      throw OutputError(images.string() +
                        ": holds something already; a recording needs a folder "
                        "of its own");
    }
  }
  make_folder(folder_ / "calibration");
  for (std::size_t i = 0; i < calibration.size(); ++i) {
    const std::string name = fs::path(calibration[i]).filename().string();
    const fs::path copy = folder_ / "calibration" / fmt::format("{}_{}", i, name);
    write_file(copy, read_text_file(calibration[i]));
    calibration_.push_back(copy.string());
  }
}

fs::path SetRecorder::path_of(LiveCamera camera, std::int64_t stamp) const {
  return folder_ / to_string(camera) / fmt::format("{:019d}.png", stamp);
}

void SetRecorder::write(LiveCamera camera, std::int64_t stamp, const GrayImage& image) const {
  const cv::Mat pixels(image.height, image.width, CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));  // which is only read
  write_picture(path_of(camera, stamp), pixels);
}

std::string SetRecorder::add(const ImageSet& set) {
  if (failed_) return {};
  const std::int64_t stamp = set.left.stamp;
  try {
    if (set.fisheye) write(LiveCamera::kFisheye, stamp, set.fisheye->image);
    write(LiveCamera::kRight, stamp, set.right.image);
    write(LiveCamera::kLeft, stamp, set.left.image);
    ++recorded_;
    return {};
  } catch (const OutputError& error) {
    failed_ = true;
    for (const LiveCamera camera : kAllLiveCameras) {  // no set without its left image
      std::error_code ignored;
      fs::remove(path_of(camera, stamp), ignored);
    }
    return fmt::format("{}; the recording ends with {} sets, and the run goes on", error.what(),
                       recorded_);
  }
}

}  // namespace hybrid_slam
