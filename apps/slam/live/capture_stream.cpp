#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <set>
#include <span>
#include <system_error>

#include "apps/slam/live/capture_protocol.h"
#include "apps/slam/live/image_stream.h"
#include "cameras/files/input_error.h"
#include "frontend/input/child_output.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr const char* kProgram = "stream_capture";

// Beside this program, as in the build folder; where it is installed; else wherever PATH finds it.
std::string find_program() {
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  for (const fs::path& place : {folder / kProgram, folder / "../libexec/hybrid_slam" / kProgram}) {
    if (!error && fs::exists(place)) return place.string();
  }
  return kProgram;
}

// "; this machine has /dev/video0, /dev/video2", for who asked for another.
std::string cameras_here() {
  std::set<std::string> cameras;
  std::error_code error;
  for (const fs::directory_entry& device : fs::directory_iterator("/dev", error)) {
    if (device.path().filename().string().starts_with("video")) cameras.insert(device.path());
  }
  return fmt::format("; this machine has {}",
                     cameras.empty() ? "none" : fmt::to_string(fmt::join(cameras, ", ")));
}

template <typename T>
bool read(ChildOutput& output, T& value) {
  std::uint8_t bytes[sizeof(T)];
  if (output.read(bytes) < sizeof(T)) return false;
  std::memcpy(&value, bytes, sizeof(T));
  return true;
}

class CaptureStream final : public ImageStream {
 public:
  CaptureStream(const std::string& name, double timeout, GrayChannel channel)
      : name_(name),
        is_file_(kind_of_stream(name) == StreamKind::kFile),
        capture_({find_program(), name, std::to_string(timeout),
                  std::to_string(static_cast<int>(channel))}) {
    CaptureHello hello;
    if (!read(capture_, hello)) throw InputError(name + ": cannot be opened");
    if (hello.magic != CaptureHello::kMagic) {
      throw InputError(name + ": " + kProgram + " is that of another version");
    }
    rate_ = hello.rate;
  }

  std::optional<StreamImage> next() override {
    CaptureFrame frame;
    if (!read(capture_, frame)) return std::nullopt;
    if (frame.width <= 0 || frame.height <= 0) {
      throw InputError(name_ + ": images with such pixels cannot be read");
    }
    StreamImage image{{frame.width, frame.height, {}}, {}, std::nullopt};
    image.image.pixels.resize(static_cast<std::size_t>(frame.width) *
                              static_cast<std::size_t>(frame.height));
    if (capture_.read(image.image.pixels) < image.image.pixels.size()) return std::nullopt;
    image.time = std::chrono::steady_clock::time_point(std::chrono::nanoseconds(frame.steady_ns));
    if (is_file_) image.position = frame.position;
    return image;
  }

  double rate() const override { return rate_; }

 private:
  const std::string name_;
  const bool is_file_;
  ChildOutput capture_;
  double rate_ = 0;
};

}  // namespace

std::unique_ptr<ImageStream> open_stream(const std::string& name, double timeout,
                                         GrayChannel channel) {
  const StreamKind kind = kind_of_stream(name);
  const std::string path = is_device_number(name) ? "/dev/video" + name : name;
  const bool has_path = kind == StreamKind::kDevice || kind == StreamKind::kFile;
  if (has_path && !fs::exists(path)) {
    throw InputError(kind == StreamKind::kDevice
                         ? path + ": no such camera" + cameras_here()
                         : name + ": no such video; streams are named as in rtsp://...");
  }
  try {
    return std::make_unique<CaptureStream>(name, timeout, channel);
  } catch (const InputError& error) {
    const std::string reason = error.what();
    if (reason.starts_with(name)) throw;
    throw InputError(name + ": streams are read by another program: " + reason +
                     " (Debian package hybrid-slam-live)");
  }
}

}  // namespace hybrid_slam
