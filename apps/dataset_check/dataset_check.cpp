#include "apps/dataset_check/dataset_check.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "apps/dataset_check/dataset_findings.h"
#include "apps/slam/diagnosis.h"
#include "apps/slam/frame_extractor.h"
#include "apps/slam/parallel_for.h"
#include "frontend/input/median.h"

namespace hybrid_slam {
namespace {

// A frame as it comes from the threads that read and look.
struct LookedAt {
  std::string error;  // the pair cannot be read
  bool has_features = false;
  std::optional<CameraFrame> stereo;
  std::optional<CameraFrame> fisheye;
  std::vector<PairMatch> matches;
};

FirstImages first_images(const ImageSequence& sequence) {
  FirstImages first;
  for (std::size_t i = 0; i < sequence.size() && first.stereo.size() < FirstImages::kStereo; ++i) {
    try {
      FrameImages images = sequence.read(i);
      const Nanoseconds time = to_nanoseconds(images.time);
      first.stereo.push_back(std::make_shared<const StereoImages>(
          StereoImages{time, std::move(images.left), std::move(images.right)}));
      if (images.fisheye.empty()) continue;
      first.fisheye.push_back(
          std::make_shared<const FisheyeImage>(FisheyeImage{time, std::move(images.fisheye)}));
    } catch (const InputError&) {  // counted when the frame is read again
    }
  }
  return first;
}

// A frame by the greys of its images alone.
CameraFrame plain_frame(CameraKind camera, Nanoseconds time, const GrayImage& image,
                        std::vector<ImageQuality> qualities) {
  return {camera,
          time,
          make_frame(0, to_seconds(time), {}, image.width, image.height),
          {std::move(qualities), 0, std::nullopt, 0, 0}};
}

LookedAt look_at(const ImageSequence& sequence, std::size_t index, bool find_features,
                 FrameExtractor& extractor) {
  LookedAt result;
  result.has_features = find_features;
  FrameImages images;
  try {
    images = sequence.read(index);
  } catch (const InputError& error) {
    result.error = error.what();
    return result;
  }
  const Nanoseconds time = to_nanoseconds(images.time);
  StageTimes ignored;
  if (!find_features) {
    result.stereo = plain_frame(CameraKind::kStereo, time, images.left,
                                {image_quality(images.left), image_quality(images.right)});
    if (images.fisheye.empty()) return result;
    result.fisheye =
        plain_frame(CameraKind::kFisheye, time, images.fisheye, {image_quality(images.fisheye)});
    return result;
  }
  result.stereo = extractor.extract(
      StereoImages{time, std::move(images.left), std::move(images.right)}, true, ignored);
  const StereoFeatures& features = result.stereo->frame.features;
  result.matches = match_pair(features.left, features.right);
  if (!images.fisheye.empty()) {
    result.fisheye = extractor.extract(FisheyeImage{time, std::move(images.fisheye)}, ignored);
  }
  return result;
}

// What is known of a frame without features.
bool needs_features(Cause cause) {
  switch (cause) {
    case Cause::kFewFeatures:
    case Cause::kFisheyeBlind:
    case Cause::kFewStereoMatches:
    case Cause::kSwapped:
    case Cause::kCalibrationDoubtful:
      return true;
    default:
      return false;
  }
}

// Puts frames together, in order.
class Survey {
 public:
  Survey(const SequenceInfo& info, int features, DatasetCheck& check)
      : check_(check), diagnosis_(features, info.fisheye.has_value()) {}

  void add(std::size_t index, const LookedAt& seen) {
    if (!seen.error.empty()) {
      check_.unreadable.push_back({index, 0, seen.error});
      return;
    }
    look(index, *seen.stereo, seen.has_features, check_.stereo, stereo_);
    check_.pairs.add(seen.matches);
    if (seen.fisheye) {
      look(index, *seen.fisheye, seen.has_features, check_.fisheye, fisheye_);
    } else if (check_.info.fisheye) {
      ++check_.fisheye_missing;
    }
  }

  void finish() {
    settle(stereo_, check_.stereo, check_.stereo_features);
    settle(fisheye_, check_.fisheye, check_.fisheye_features);
  }

 private:
  struct Values {
    std::vector<double> brightness, blur, features, matched;
  };

  void look(std::size_t index, const CameraFrame& frame, bool has_features, ImageSurvey& images,
            Values& values) {
    ++images.images;
    for (const ImageQuality& quality : frame.evidence.images) {
      values.brightness.push_back(quality.brightest);
      values.blur.push_back(quality.blur);
    }
    if (has_features) {
      const auto count = static_cast<double>(frame.frame.size());
      const auto& rights = frame.frame.features.right_of_left;
      const auto matches =
          std::count_if(rights.begin(), rights.end(), [](int k) { return k >= 0; });
      values.features.push_back(count);
      values.matched.push_back(count > 0 ? static_cast<double>(matches) / count : 0);
    }
    for (const FoundCause& found : diagnosis_.look(frame)) {
      if (needs_features(found.cause) && !has_features) continue;
      ++images.causes[to_string(found.cause)];
      if (found.cause == Cause::kTimeJump && frame.camera == CameraKind::kStereo) {
        check_.gaps.push_back({index, found.value, {}});
      }
    }
  }

  static void settle(Values& values, ImageSurvey& images, FeatureSurvey& features) {
    images.brightness = median(std::move(values.brightness));
    images.blur = median(std::move(values.blur));
    features.frames = values.features.size();
    features.features = median(std::move(values.features));
    features.matched = median(std::move(values.matched));
  }

  DatasetCheck& check_;
  Diagnosis diagnosis_;
  Values stereo_, fisheye_;
};

FrameRate rate_of(const std::vector<double>& times) {
  FrameRate rate;
  if (times.size() < 2) return rate;
  std::vector<double> steps;
  for (std::size_t i = 1; i < times.size(); ++i) steps.push_back(times[i] - times[i - 1]);
  rate.duration = times.back() - times.front();
  rate.shortest = *std::min_element(steps.begin(), steps.end());
  rate.longest = *std::max_element(steps.begin(), steps.end());
  rate.period = median(std::move(steps));
  return rate;
}

}  // namespace

DatasetCheck check_dataset(const ImageSequence& sequence, const DatasetCheckOptions& options,
                           const std::function<void(std::size_t, std::size_t)>& progress,
                           const std::stop_token& stop) {
  DatasetCheck check;
  check.info = sequence.info();
  check.pairs = PairSurvey(check.info.stereo.width, check.info.stereo.height);
  check.rate = rate_of(check.info.times);
  SlamOptions as_they_are = options.slam;
  as_they_are.align_pair = false;  // rows that are off are what the check is asked for
  FrameExtractor extractor({check.info.stereo, check.info.fisheye}, as_they_are, options.device,
                           first_images(sequence));
  Survey survey(check.info, options.slam.features, check);
  const std::size_t total = sequence.size();
  const std::size_t pairs = std::min(std::max<std::size_t>(options.pairs, 1), total);
  const auto is_sampled = [&](std::size_t i) { return i * pairs % total < pairs; };
  const std::size_t batch = 4 * static_cast<std::size_t>(options.threads);
  for (std::size_t begin = 0; begin < total && !stop.stop_requested(); begin += batch) {
    std::vector<LookedAt> seen(std::min(batch, total - begin));
    parallel_for(seen.size(), options.threads, [&](std::size_t i, std::size_t) {
      seen[i] = look_at(sequence, begin + i, is_sampled(begin + i), extractor);
    });
    for (std::size_t i = 0; i < seen.size(); ++i) survey.add(begin + i, seen[i]);
    if (progress) progress(begin + seen.size(), total);
  }
  check.cancelled = stop.stop_requested();
  survey.finish();
  judge(check);
  return check;
}

}  // namespace hybrid_slam
