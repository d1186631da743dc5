#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "frontend/input/child_output.h"
#include "frontend/input/image_file.h"

namespace hybrid_slam {

// Whether a file's name ends like that of a video.
bool is_video_name(const std::filesystem::path& path);

// The images of a video, decoded by the program ffmpeg when asked for: fast in their order, and
// with a new start for an earlier one. They are those of "ffmpeg -i VIDEO -fps_mode passthrough
// %06d.png". One thread at a time.
class VideoFile {
 public:
  // Throws InputError if it cannot be read or holds no frames, or ffmpeg is not installed.
  explicit VideoFile(const std::filesystem::path& path);

  ImageSize size() const { return size_; }
  // As the file has them, from the first one on [s].
  const std::vector<double>& times() const { return times_; }

  // Throws InputError if the frame cannot be decoded.
  GrayImage read(std::size_t frame, GrayChannel channel);

 private:
  void read_header();
  void start();

  std::filesystem::path path_;
  std::unique_ptr<ChildOutput> decoder_;
  std::size_t next_ = 0;  // frame that the decoder gives next
  ImageSize size_;
  std::vector<double> times_;
};

}  // namespace hybrid_slam
