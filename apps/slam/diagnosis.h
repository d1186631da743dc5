#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "apps/slam/inputs.h"

namespace hybrid_slam {

// What may be wrong with a frame, and how much of it. Why each bound is what it is:
// docs/reliability.md.
enum class Cause {
  kFewFeatures,          // share of the features asked for
  kDark,                 // grey level that 99 % of the pixels do not exceed
  kSaturated,            // share of the pixels that are white
  kBlurred,              // 0..1, see ImageQuality
  kFewStereoMatches,     // share of the features with a match in the right image
  kSwapped,              // share of matches whose points would lie behind the cameras
  kTimeJump,             // time since the camera's frame before [s]
  kDisorder,             // inputs that came too late, since the frame before
  kPartnerMissing,       // time since the other camera's frame [s]
  kBehind,               // frames left out for want of time, since the frame before
  kMasked,               // share of the image that is masked
  kCalibrationDoubtful,  // error of the rows in the pair, or offset of the disparities [px]
  kFisheyeBlind,         // share of the features asked for
  kFrozen,               // how many frames in a row of the same pixels
};

inline constexpr int kCauses = 14;

// One word, as in frames.csv and summary.json: "few_features".
const char* to_string(Cause cause);

struct FoundCause {
  Cause cause = Cause::kFewFeatures;
  double value = 0;  // in the cause's own unit, see above
};

// For people: "dark: 99 % of the pixels are below 13 of 255".
std::string describe(const FoundCause& found);

// Finds out what is wrong with each frame by what came before it. Frames in the order of their
// times. One thread.
class Diagnosis {
 public:
  // `features`: asked for per image.
  Diagnosis(int features, bool fisheye) : features_(features), fisheye_(fisheye) {}

  // Before it is tracked. Counts what the stream left out since the frame before.
  std::vector<FoundCause> look(const CameraFrame& frame);

  // What tracking adds: the offset that it finds in the disparities [px].
  static std::optional<FoundCause> look_at_offset(double disparity_offset);

 private:
  struct Past {
    std::optional<Nanoseconds> time;
    std::deque<double> periods;  // the last ones, ascending in time [s]
    std::array<std::uint64_t, 2> signatures{};
    int frozen = 0;
  };
  using Found = std::vector<FoundCause>;

  void look_at_images(const CameraFrame& frame, Found& found);
  void look_at_features(const CameraFrame& frame, Found& found);
  void look_at_pair(const CameraFrame& frame, Found& found);
  void look_at_times(const CameraFrame& frame, Found& found);
  static std::optional<double> period(const Past& past);
  Past& past(CameraKind camera) { return past_[static_cast<std::size_t>(camera)]; }

  int features_;
  bool fisheye_;
  std::array<Past, 2> past_;          // by CameraKind
  std::optional<Nanoseconds> first_;  // time of any camera
  std::optional<PairCheck> pair_;     // the newest
};

}  // namespace hybrid_slam
