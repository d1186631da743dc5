#include "apps/slam/diagnosis.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "frontend/calibration/pair_alignment.h"

namespace hybrid_slam {
namespace {

constexpr double kFewFeaturesShare = 0.1;  // of those asked for
constexpr double kDarkLevel = 64;          // a quarter of the range
constexpr double kSaturatedShare = 0.25;   // of the pixels
constexpr double kBlurredShare = 0.5;      // see ImageQuality::blur
constexpr double kFewMatchesShare = 0.1;   // of the features
constexpr double kMaskedShare = 0.5;       // of the pixels
constexpr double kRowError = 1;            // [px] beyond which the matcher loses every second one
constexpr double kDisparityOffset = 2;     // [px]
constexpr double kPeriods = 5;             // so many of them are a jump, or an absence
constexpr std::size_t kPastPeriods = 15;   // that the usual one is the median of
constexpr std::size_t kKnownPeriods = 3;   // without so many, nothing is usual
constexpr double kAbsence = 2;             // [s] of a camera that never showed anything

// Matches of which more than chance allows are reversed: if each were as likely as not, four
// standard deviations.
bool is_swapped(const PairCheck& pair) {
  return pair.matches > 0 && pair.reversed > 0.5 + 2 / std::sqrt(pair.matches);
}

// As few as may all be wrong tell nothing of the rows.
bool has_row_error(const PairCheck& pair) {
  return pair.matches > 16 && !is_swapped(pair) && pair.row_error > kRowError;
}

}  // namespace

const char* to_string(Cause cause) {
  switch (cause) {
    case Cause::kFewFeatures:
      return "few_features";
    case Cause::kDark:
      return "dark";
    case Cause::kSaturated:
      return "saturated";
    case Cause::kBlurred:
      return "blurred";
    case Cause::kFewStereoMatches:
      return "few_stereo_matches";
    case Cause::kSwapped:
      return "swapped";
    case Cause::kTimeJump:
      return "time_jump";
    case Cause::kDisorder:
      return "disorder";
    case Cause::kPartnerMissing:
      return "partner_missing";
    case Cause::kBehind:
      return "behind";
    case Cause::kMasked:
      return "masked";
    case Cause::kCalibrationDoubtful:
      return "calibration_doubtful";
    case Cause::kFisheyeBlind:
      return "fisheye_blind";
    case Cause::kFrozen:
      break;
  }
  return "frozen";
}

std::string describe(const FoundCause& found) {
  const double value = found.value;
  const double percent = 100 * value;
  switch (found.cause) {
    case Cause::kFewFeatures:
      return fmt::format("too few features: {:.0f} % of those asked for", percent);
    case Cause::kDark:
      return fmt::format("dark: 99 % of the pixels are at {:.0f} of 255 or below", value);
    case Cause::kSaturated:
      return fmt::format("saturated: {:.0f} % of the pixels are white", percent);
    case Cause::kBlurred:
      return fmt::format("blurred: {:.2f}, where 0.3 is sharp and 0.7 a blur of 15 pixels", value);
    case Cause::kFewStereoMatches:
      return fmt::format("hardly any stereo matches: {:.0f} % of the features", percent);
    case Cause::kSwapped:
      return fmt::format("left and right swapped: {:.0f} % of the matches lie behind the cameras",
                         percent);
    case Cause::kTimeJump:
      return fmt::format("time jump: {:.3f} s since the frame before", value);
    case Cause::kDisorder:
      return fmt::format("disorder: {:.0f} inputs came too late", value);
    case Cause::kPartnerMissing:
      return fmt::format("partner missing: the other camera's last frame is {:.3f} s old", value);
    case Cause::kBehind:
      return fmt::format("behind real time: {:.0f} frames left out", value);
    case Cause::kMasked:
      return fmt::format("mask covers {:.0f} % of the image", percent);
    case Cause::kCalibrationDoubtful:
      return fmt::format("calibration doubtful: rows or disparities are off by {:.1f} px", value);
    case Cause::kFisheyeBlind:
      return fmt::format("fisheye blind: {:.0f} % of the features asked for", percent);
    case Cause::kFrozen:
      break;
  }
  return fmt::format("frozen: {:.0f} frames in a row of the same pixels", value);
}

std::vector<FoundCause> Diagnosis::look(const CameraFrame& frame) {
  Found found;
  look_at_times(frame, found);
  look_at_images(frame, found);
  look_at_features(frame, found);
  if (frame.camera == CameraKind::kStereo) look_at_pair(frame, found);
  return found;
}

std::optional<FoundCause> Diagnosis::look_at_offset(double disparity_offset) {
  const double offset = std::abs(disparity_offset);
  if (offset <= kDisparityOffset) return std::nullopt;
  return FoundCause{Cause::kCalibrationDoubtful, offset};
}

// The worse one of the two images counts.
void Diagnosis::look_at_images(const CameraFrame& frame, Found& found) {
  const FrameEvidence& evidence = frame.evidence;
  if (evidence.masked > kMaskedShare) found.push_back({Cause::kMasked, evidence.masked});
  if (evidence.images.empty()) return;
  double brightest = 255;
  double saturated = 0;
  double blur = 0;
  bool frozen = false;
  Past& before = past(frame.camera);
  for (std::size_t i = 0; i < evidence.images.size(); ++i) {
    const ImageQuality& image = evidence.images[i];
    brightest = std::min(brightest, image.brightest);
    saturated = std::max(saturated, image.saturated);
    blur = std::max(blur, image.blur);
    if (before.signatures[i] == image.signature) frozen = true;
    before.signatures[i] = image.signature;
  }
  before.frozen = frozen ? before.frozen + 1 : 0;
  if (brightest < kDarkLevel) {
    found.push_back({Cause::kDark, brightest});  // what little there is may well look blurred
  } else if (blur > kBlurredShare) {
    found.push_back({Cause::kBlurred, blur});
  }
  if (saturated > kSaturatedShare) found.push_back({Cause::kSaturated, saturated});
  if (frozen && brightest >= kDarkLevel) {  // black images are all the same
    found.push_back({Cause::kFrozen, static_cast<double>(before.frozen + 1)});
  }
}

void Diagnosis::look_at_features(const CameraFrame& frame, Found& found) {
  const auto count = static_cast<double>(frame.frame.size());
  const double share = count / features_;
  if (share < kFewFeaturesShare) {
    const bool stereo = frame.camera == CameraKind::kStereo;
    found.push_back({stereo ? Cause::kFewFeatures : Cause::kFisheyeBlind, share});
  } else if (frame.camera == CameraKind::kStereo) {
    const auto& rights = frame.frame.features.right_of_left;
    const auto matches = std::count_if(rights.begin(), rights.end(), [](int k) { return k >= 0; });
    const double matched = static_cast<double>(matches) / count;
    if (matched < kFewMatchesShare) found.push_back({Cause::kFewStereoMatches, matched});
  }
}

// Pairs that hardly match are all looked at, so those that are swapped are among them. Of the
// others not every one is, and the rows that were found last hold.
void Diagnosis::look_at_pair(const CameraFrame& frame, Found& found) {
  if (frame.evidence.pair) pair_ = frame.evidence.pair;
  if (frame.evidence.pair && is_swapped(*pair_)) {
    found.push_back({Cause::kSwapped, pair_->reversed});
  }
  if (frame.evidence.alignment && frame.evidence.alignment->row_rms > kRowError) {
    found.push_back({Cause::kCalibrationDoubtful, frame.evidence.alignment->row_rms});
    return;  // the images that were compared are without it
  }
  if (!pair_) return;
  if (has_row_error(*pair_)) found.push_back({Cause::kCalibrationDoubtful, pair_->row_error});
}

void Diagnosis::look_at_times(const CameraFrame& frame, Found& found) {
  const FrameEvidence& evidence = frame.evidence;
  if (evidence.late > 0) found.push_back({Cause::kDisorder, static_cast<double>(evidence.late)});
  if (evidence.dropped > 0) {
    found.push_back({Cause::kBehind, static_cast<double>(evidence.dropped)});
  }
  Past& mine = past(frame.camera);
  if (mine.time) {
    const double passed = to_seconds(frame.time - *mine.time);
    const auto usual = period(mine);
    const bool jump = passed < 0 || (usual && passed > kPeriods * *usual);
    if (jump && evidence.dropped == 0) found.push_back({Cause::kTimeJump, passed});
    if (passed > 0 && !jump) mine.periods.push_back(passed);
    if (mine.periods.size() > kPastPeriods) mine.periods.pop_front();
  }
  mine.time = frame.time;
  if (!first_ || frame.time < *first_) first_ = frame.time;
  if (!fisheye_) return;
  const Past& other =
      past(frame.camera == CameraKind::kStereo ? CameraKind::kFisheye : CameraKind::kStereo);
  const double absent = to_seconds(frame.time - other.time.value_or(*first_));
  const auto usual = period(other);
  if (absent > (usual ? kPeriods * *usual : kAbsence)) {
    found.push_back({Cause::kPartnerMissing, absent});
  }
}

// The usual time between two frames [s].
std::optional<double> Diagnosis::period(const Past& past) {
  if (past.periods.size() < kKnownPeriods) return std::nullopt;
  std::vector<double> sorted(past.periods.begin(), past.periods.end());
  std::sort(sorted.begin(), sorted.end());
  return sorted[sorted.size() / 2];
}

}  // namespace hybrid_slam
