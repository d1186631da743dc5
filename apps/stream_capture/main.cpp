// stream_capture STREAM TIMEOUT CHANNEL: opens a camera, a stream or a video by OpenCV's
// VideoCapture and writes its images to the standard output, as apps/slam/live/capture_protocol.h
// says. Part of "hybrid_slam live", which starts it. It ends with the stream, with its reader, or
// when nothing has come for TIMEOUT seconds, whatever library is waited for. Exit code 3: the
// stream cannot be opened.

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>

#include "apps/slam/live/capture_protocol.h"
#include "frontend/input/image_decoders.h"

namespace hybrid_slam {
namespace {

constexpr int kBadUsage = 2, kCannotOpen = 3;

// The process ends after so long, unless this is called again.
void end_after(double seconds) { alarm(static_cast<unsigned>(std::ceil(seconds))); }

bool open(cv::VideoCapture& capture, const std::string& name, double timeout) {
  const int limit = static_cast<int>(1e3 * timeout);
  switch (kind_of_stream(name)) {
    case StreamKind::kDevice:
      if (!(is_device_number(name) ? capture.open(std::stoi(name), cv::CAP_V4L2)
                                   : capture.open(name, cv::CAP_V4L2))) {
        return false;
      }
      capture.set(cv::CAP_PROP_BUFFERSIZE, 1);
      return true;
    case StreamKind::kPipeline:
      return capture.open(name, cv::CAP_GSTREAMER);
    case StreamKind::kFile:
      return capture.open(name, cv::CAP_FFMPEG);
    case StreamKind::kUrl:
      break;
  }
  return capture.open(
      name, cv::CAP_FFMPEG,
      {cv::CAP_PROP_OPEN_TIMEOUT_MSEC, limit, cv::CAP_PROP_READ_TIMEOUT_MSEC, limit});
}

template <typename T>
bool write(const T& value) {
  return std::fwrite(&value, sizeof(T), 1, stdout) == 1;
}

// Empty if its pixels are of a kind that is not known.
GrayImage to_gray(const cv::Mat& picture, GrayChannel channel) {
  GrayImage image{picture.cols, picture.rows, {}};
  const int channels = picture.channels();
  if (picture.depth() != CV_8U || (channels != 1 && channels != 3)) return {};
  image.pixels.reserve(picture.total());
  for (int y = 0; y < picture.rows; ++y) {
    const std::uint8_t* at = picture.ptr(y);
    const std::uint8_t* const end = at + picture.cols * channels;
    if (channels == 1) image.pixels.insert(image.pixels.end(), at, end);
    for (; channels == 3 && at < end; at += 3) {  // blue, green, red
      image.pixels.push_back(gray_of(at[2], at[1], at[0], channel));
    }
  }
  return image;
}

bool write_frame(const GrayImage& image, std::chrono::steady_clock::time_point time,
                 double position) {
  CaptureFrame frame;
  frame.steady_ns =
      std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
  frame.position = position;
  frame.width = image.width;
  frame.height = image.height;
  return write(frame) &&
         std::fwrite(image.pixels.data(), 1, image.pixels.size(), stdout) == image.pixels.size() &&
         std::fflush(stdout) == 0;
}

int capture(const std::string& name, double timeout, GrayChannel channel) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  cv::VideoCapture stream;
  end_after(timeout + 5);  // opening looks at the stream for some seconds
  if (!open(stream, name, timeout)) return kCannotOpen;
  stream.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);  // the calibration is that of the stored pixels
  CaptureHello hello;
  const double rate = stream.get(cv::CAP_PROP_FPS);
  if (rate > 0.01 && rate < 1000) hello.rate = rate;  // others are ticks of a clock
  if (!write(hello) || std::fflush(stdout) != 0) return 0;
  cv::Mat picture;
  while (true) {
    end_after(timeout);
    if (!stream.grab()) return 0;
    const auto time = std::chrono::steady_clock::now();
    const double position = 1e-3 * stream.get(cv::CAP_PROP_POS_MSEC);
    if (!stream.retrieve(picture) || picture.empty()) return 0;
    const GrayImage image = to_gray(picture, channel);
    alarm(0);  // who reads may take its time
    if (!write_frame(image, time, position) || image.empty()) return 0;
  }
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  using namespace hybrid_slam;
  if (argc != 4) {
    std::fputs("usage: stream_capture STREAM TIMEOUT CHANNEL; part of \"hybrid_slam live\"\n",
               stderr);
    return kBadUsage;
  }
  try {
    return capture(argv[1], std::atof(argv[2]), static_cast<GrayChannel>(std::atoi(argv[3])));
  } catch (const cv::Exception&) {  // of a pipeline that is none, say
    return kCannotOpen;
  }
}
