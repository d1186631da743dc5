#pragma once

#include <cstdint>
#include <string>

// What the program stream_capture writes to its standard output: a CaptureHello, then of each image
// a CaptureFrame and its grey pixels, row by row. Both sides are of one build and one machine.
namespace hybrid_slam {

// What a stream's name stands for.
enum class StreamKind {
  kDevice,    // 0, /dev/video0
  kUrl,       // rtsp://, udp://, http:// ...
  kPipeline,  // of GStreamer: "udpsrc port=5000 ! ... ! appsink"
  kFile,      // a video
};

inline bool is_device_number(const std::string& name) {
  return !name.empty() && name.size() < 5 &&
         name.find_first_not_of("0123456789") == std::string::npos;
}

inline StreamKind kind_of_stream(const std::string& name) {
  if (is_device_number(name) || name.starts_with("/dev/")) return StreamKind::kDevice;
  if (name.find(" ! ") != std::string::npos) return StreamKind::kPipeline;
  if (name.find("://") != std::string::npos) return StreamKind::kUrl;
  return StreamKind::kFile;
}

struct CaptureHello {
  static constexpr std::uint64_t kMagic = 0x31747061'63736c68;  // "hlscapt1"
  std::uint64_t magic = kMagic;
  double rate = 0;  // images per second, as the stream says; 0: it does not
};

struct CaptureFrame {
  std::int64_t steady_ns = 0;  // when it came, by the machine's steady clock
  double position = 0;         // [s] since the stream's beginning
  std::int32_t width = 0;
  std::int32_t height = 0;
};

}  // namespace hybrid_slam
