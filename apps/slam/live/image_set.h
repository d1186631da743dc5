#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>

#include "frontend/features/image.h"

namespace hybrid_slam {

enum class LiveCamera { kLeft, kRight, kFisheye };
inline constexpr std::size_t kLiveCameras = 3;
inline constexpr std::array<LiveCamera, kLiveCameras> kAllLiveCameras{
    LiveCamera::kLeft, LiveCamera::kRight, LiveCamera::kFisheye};

inline const char* to_string(LiveCamera camera) {
  constexpr const char* kNames[] = {"left", "right", "fisheye"};
  return kNames[static_cast<std::size_t>(camera)];
}

// Something of each camera.
template <typename T>
using PerCamera = std::array<T, kLiveCameras>;
template <typename T>
T& of(PerCamera<T>& all, LiveCamera camera) {
  return all[static_cast<std::size_t>(camera)];
}
template <typename T>
const T& of(const PerCamera<T>& all, LiveCamera camera) {
  return all[static_cast<std::size_t>(camera)];
}

// A grey image as the camera gave it, and its time: UNIX time [ns].
struct StampedImage {
  std::int64_t stamp = 0;
  GrayImage image;
  std::filesystem::path file;  // where it has yet to be read from; empty: it is there
};

// Images of one moment, that of the left one.
struct ImageSet {
  StampedImage left, right;
  std::optional<StampedImage> fisheye{};
  std::string error{};          // why the pair cannot be read; empty: it can
  std::string fisheye_error{};  // likewise, of a fisheye image
};

// Hears what was found on the way, one line each.
using TellLine = std::function<void(const std::string&)>;

// What was seen on the way, for the summary.
struct LiveCounts {
  PerCamera<std::int64_t> images{};   // that came
  PerCamera<std::int64_t> alone{};    // that no other camera's belonged to
  PerCamera<std::int64_t> held_up{};  // left out: they came in a burst
  PerCamera<std::int64_t> dropped{};  // they came while the one before waited for the SLAM
  PerCamera<int> lost{};              // how often the camera was lost
};

// Where sets come from: streams, or a folder that grows. One thread.
class SetSource {
 public:
  virtual ~SetSource() = default;

  // Waits for the next set. None once there will be no more, or `stop` is requested. Throws
  // InputError if the cameras cannot be opened, deliver nothing, or their images cannot be brought
  // together; the first call says so, if at all.
  virtual std::optional<ImageSet> next(const std::stop_token& stop) = 0;

  virtual LiveCounts counts() const = 0;

  // Called by next(), in its thread; none: nobody is told.
  void set_tell(TellLine tell) { tell_ = std::move(tell); }

 protected:
  void tell(const std::string& line) const {
    if (tell_) tell_(line);
  }

 private:
  TellLine tell_;
};

}  // namespace hybrid_slam
