#include "apps/dataset_check/footage_meaning.h"

#include <fmt/format.h>

#include <utility>

#include "apps/dataset_check/pair_survey.h"
#include "apps/slam/one_at_a_time.h"
#include "frontend/features/sift.h"
#include "frontend/input/video_file.h"

namespace hybrid_slam {
namespace {

// A sequence with a line more in its warnings.
class NotedSequence final : public ImageSequence {
 public:
  NotedSequence(std::unique_ptr<ImageSequence> sequence, std::string note)
      : sequence_(std::move(sequence)), info_(sequence_->info()) {
    info_.warnings.push_back(std::move(note));
  }
  const SequenceInfo& info() const override { return info_; }
  FrameImages read(std::size_t frame) const override { return sequence_->read(frame); }

 private:
  std::unique_ptr<ImageSequence> sequence_;
  SequenceInfo info_;
};

// Of a few pairs from all over the sequence that can be read.
RowAgreement look_at_rows(const ImageSequence& sequence) {
  constexpr std::size_t kPairs = 5;
  const SequenceInfo& info = sequence.info();
  PairSurvey survey(info.stereo.width, info.stereo.height);
  SiftOptions options;
  options.upsample = false;
  const auto sift = make_sift(options);
  const std::size_t count = std::min(kPairs, sequence.size());
  for (std::size_t i = 0; i < count; ++i) {
    try {
      const FrameImages images = sequence.read(i * sequence.size() / count);
      const FeatureSet left = sift->extract(images.left, nullptr);
      survey.add(match_pair(left, sift->extract(images.right, nullptr)));
    } catch (const InputError&) {  // counted when the frame is read
    }
  }
  return survey.rows();
}

// For any number of threads.
std::unique_ptr<ImageSequence> open_as(const Footage& footage, FootageImages images,
                                       const InputOptions& options) {
  auto sequence = open_footage(footage, images, options);
  if (!is_video_name(footage.left.front())) return sequence;
  return std::make_unique<OneAtATime>(std::move(sequence));
}

}  // namespace

bool rows_say_raw(const ImageSequence& raw, const ImageSequence& rectified, std::string& note) {
  const RowAgreement as_raw = look_at_rows(raw);
  const RowAgreement as_rectified = look_at_rows(rectified);
  const bool is_raw =
      as_raw.matches > 0 && (as_rectified.matches == 0 || as_raw.error < as_rectified.error);
  note = fmt::format(
      "{}: the images are taken for {} ones: as rectified ones their rows differ by {:.2f} px, as "
      "raw ones by {:.2f} px, in the median of {} and {} matches (--images settles it)",
      raw.info().name, is_raw ? "raw" : "rectified", as_rectified.error, as_raw.error,
      as_rectified.matches, as_raw.matches);
  return is_raw;
}

std::unique_ptr<ImageSequence> open_footage_as_it_is(const Footage& footage,
                                                     std::optional<FootageImages> images,
                                                     const InputOptions& options) {
  if (images) return open_as(footage, *images, options);
  const FootageMeanings meanings = footage_meanings(footage);
  if (!meanings.raw) return open_as(footage, FootageImages::kRectified, options);
  if (!meanings.rectified) return open_as(footage, FootageImages::kRaw, options);
  auto raw = open_as(footage, FootageImages::kRaw, options);
  auto rectified = open_as(footage, FootageImages::kRectified, options);
  std::string note;
  const bool is_raw = rows_say_raw(*raw, *rectified, note);
  return std::make_unique<NotedSequence>(std::move(is_raw ? raw : rectified), std::move(note));
}

}  // namespace hybrid_slam
