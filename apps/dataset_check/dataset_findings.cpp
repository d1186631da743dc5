#include "apps/dataset_check/dataset_findings.h"

#include <fmt/format.h>

#include <algorithm>

#include "apps/slam/diagnosis.h"
#include "frontend/input/file_sequence.h"

namespace hybrid_slam {
namespace {

void look_for_missing(DatasetCheck& check) {
  const SequenceInfo& info = check.info;
  if (info.truth.empty()) {
    check.missing.push_back("true poses: no error can be computed");
  } else if (!info.truth_has_rotation) {
    check.missing.push_back("rotations of the true poses");
  }
  if (!info.fisheye) check.missing.push_back("a fisheye: the map is of the stereo pair alone");
  if (check.fisheye_missing > 0) {
    check.missing.push_back(fmt::format("fisheye images of {} frames", check.fisheye_missing));
  }
}

int count_of(const ImageSurvey& images, Cause cause) {
  const auto found = images.causes.find(to_string(cause));
  return found == images.causes.end() ? 0 : found->second;
}

// Causes that are a finding where more than a tenth of the frames have them.
void find_in_images(const ImageSurvey& images, const std::string& camera, DatasetCheck& check) {
  struct Named {
    Cause cause;
    const char* text;
  };
  for (const auto& [cause, text] :
       {Named{Cause::kDark, "are dark: more light, exposure or gain"},
        Named{Cause::kSaturated, "are white in a quarter or more: less exposure or gain"},
        Named{Cause::kBlurred, "are blurred: focus, or a shorter exposure"},
        Named{Cause::kFrozen, "show the same pixels as those before"}}) {
    const int count = count_of(images, cause);
    if (10 * static_cast<std::size_t>(count) <= images.images) continue;
    check.findings.push_back(
        {to_string(cause), fmt::format("{} of {} {} {}", count, images.images, camera, text)});
  }
}

void find_in_frames(DatasetCheck& check) {
  if (!check.unreadable.empty()) {
    check.findings.push_back(
        {"unreadable",
         fmt::format("{} of {} stereo pairs cannot be read, the first is frame {}: {}",
                     check.unreadable.size(), check.info.times.size(),
                     check.unreadable.front().frame, check.unreadable.front().text)});
  }
  if (!check.gaps.empty()) {
    const auto longest = std::max_element(
        check.gaps.begin(), check.gaps.end(),
        [](const NamedFrame& a, const NamedFrame& b) { return a.value < b.value; });
    check.findings.push_back(
        {"gaps",
         fmt::format("{} gaps between frames, the longest of {:.3f} s before frame {}, "
                     "where {:.3f} s are usual",
                     check.gaps.size(), longest->value, longest->frame, check.rate.period)});
  }
  find_in_images(check.stereo, "stereo pairs", check);
  find_in_images(check.fisheye, "fisheye images", check);
}

// The region whose rows are furthest apart, if that is beyond what matching bears.
std::optional<std::string> worst_region(const PairSurvey& pairs, double bound) {
  constexpr int kEnough = 50;  // matches; fewer may all be wrong
  constexpr const char* kRows[] = {"upper", "middle", "lower"};
  constexpr const char* kColumns[] = {"left", "middle", "right"};
  std::optional<std::string> text;
  double worst = bound;
  for (int r = 0; r < PairSurvey::kGrid; ++r) {
    for (int c = 0; c < PairSurvey::kGrid; ++c) {
      const RowAgreement rows = pairs.rows_in(c, r);
      if (rows.matches < kEnough || rows.error <= worst) continue;
      worst = rows.error;
      text = fmt::format("in the {} {} of the image by {:.2f} px (left less right: {:+.2f} px)",
                         kRows[r], kColumns[c], rows.error, rows.offset);
    }
  }
  return text;
}

void find_in_rows(DatasetCheck& check) {
  constexpr double kRowError = 1;  // [px] beyond which the matcher loses every second one
  constexpr int kEnough = 50;
  const RowAgreement rows = check.pairs.rows();
  if (rows.matches < kEnough) return;
  const auto region = worst_region(check.pairs, kRowError);
  if (rows.error <= kRowError && !region) return;
  const char* const advice =
      ": the calibration is not that of these images, or raw images are taken for rectified ones";
  std::string text = "the rows of left and right differ ";
  if (rows.error > kRowError) {
    text += fmt::format("by {:.2f} px (left less right: {:+.2f} px)", rows.error, rows.offset);
    if (region) text += ", most ";
  }
  check.findings.push_back({"rows", text + region.value_or("") + advice});
}

void find_in_pairs(DatasetCheck& check) {
  const auto frames = static_cast<int>(check.stereo_features.frames);
  if (frames == 0) return;
  const int swapped = count_of(check.stereo, Cause::kSwapped);
  if (2 * swapped > frames) {
    check.findings.push_back(
        {"swapped", fmt::format("left and right are swapped: in {} of {} pairs most matches lie "
                                "behind the cameras ({:.0f} % of all)",
                                swapped, frames, 100 * check.pairs.reversed())});
    return;
  }
  find_in_rows(check);
  const int few = count_of(check.stereo, Cause::kFewFeatures);
  if (10 * few > frames) {
    check.findings.push_back(
        {"few_features", fmt::format("{} of {} pairs have less than a tenth of the features asked "
                                     "for",
                                     few, frames)});
  }
  const int unmatched = count_of(check.stereo, Cause::kFewStereoMatches);
  if (10 * unmatched > frames) {
    check.findings.push_back(
        {"few_stereo_matches",
         fmt::format("in {} of {} pairs less than a tenth of the features is found in the right "
                     "image: not taken at one time, or another scene",
                     unmatched, frames)});
  }
}

void find_in_fisheye(DatasetCheck& check) {
  const auto frames = static_cast<int>(check.fisheye_features.frames);
  const int blind = count_of(check.fisheye, Cause::kFisheyeBlind);
  if (10 * blind <= frames) return;
  check.findings.push_back(
      {"fisheye_blind",
       fmt::format("{} of {} fisheye images have less than a tenth of the features asked for",
                   blind, frames)});
}

void find_in_scale(DatasetCheck& check) {
  for (const std::string& doubt : doubts_of_units(check.info)) {
    check.findings.push_back({"units", doubt});
  }
  constexpr double kLeastDisparity = 4;  // [px]; a pixel then is a quarter of the distance
  const double disparity = check.pairs.disparity(50);
  const bool swapped =
      std::any_of(check.findings.begin(), check.findings.end(),
                  [](const Finding& finding) { return finding.name == "swapped"; });
  if (check.pairs.matches() == 0 || swapped || disparity >= kLeastDisparity) return;
  check.findings.push_back(
      {"far", fmt::format("the median disparity is {:.1f} px: the scene is far for this baseline, "
                          "and the scale hardly known",
                          disparity)});
}

}  // namespace

void judge(DatasetCheck& check) {
  look_for_missing(check);
  find_in_frames(check);
  find_in_fisheye(check);
  find_in_pairs(check);
  find_in_scale(check);
}

}  // namespace hybrid_slam
