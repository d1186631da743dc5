#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "frontend/features/image.h"
#include "frontend/input/image_file.h"

namespace hybrid_slam {

// One image of a stream, grey.
struct StreamImage {
  GrayImage image;
  std::chrono::steady_clock::time_point time;  // when it came
  // [s] since the stream's beginning, where it has a clock that the other streams share: videos in
  // files, which were begun together. None: its time is when it came.
  std::optional<double> position;
};

// A camera that gives one image after the other. One thread.
class ImageStream {
 public:
  virtual ~ImageStream() = default;

  // Waits for the next image. None if the stream has ended, or broken off. Throws InputError where
  // no more is to be expected.
  virtual std::optional<StreamImage> next() = 0;

  // Images per second, as the stream itself says; 0: it does not.
  virtual double rate() const { return 0; }
};

// Opens what OpenCV's VideoCapture can open, in a process of its own: the program stream_capture,
// beside ours or where it is installed. So hundreds of libraries are loaded only where they are
// needed, and one that hangs or dies is a stream that broke off. Where the other side says nothing
// for `timeout` seconds, opening fails and next() returns none. Throws InputError: name, reason.
std::unique_ptr<ImageStream> open_stream(const std::string& name, double timeout,
                                         GrayChannel channel);

}  // namespace hybrid_slam
