#include "frontend/input/part_of_sequence.h"

#include <stdexcept>
#include <utility>

namespace hybrid_slam {
namespace {

class PartOfSequence final : public ImageSequence {
 public:
  PartOfSequence(std::unique_ptr<ImageSequence> whole, std::size_t start, std::size_t every,
                 std::size_t limit)
      : whole_(std::move(whole)), start_(start), every_(every), info_(whole_->info()) {
    info_.times.clear();
    for (std::size_t i = start; i < whole_->size(); i += every) {
      if (limit > 0 && info_.times.size() == limit) break;
      info_.times.push_back(whole_->info().times[i]);
    }
  }

  const SequenceInfo& info() const override { return info_; }

  FrameImages read(std::size_t frame) const override {
    FrameImages images = whole_->read(start_ + frame * every_);
    images.frame_index = static_cast<std::int64_t>(frame);
    return images;
  }

 private:
  std::unique_ptr<ImageSequence> whole_;
  std::size_t start_;
  std::size_t every_;
  SequenceInfo info_;
};

}  // namespace

std::unique_ptr<ImageSequence> part_of_sequence(std::unique_ptr<ImageSequence> sequence,
                                                std::size_t start, std::size_t every,
                                                std::size_t limit) {
  if (every == 0) throw std::logic_error("every frame, or every n-th");
  if (start == 0 && every == 1 && (limit == 0 || limit >= sequence->size())) return sequence;
  if (start >= sequence->size()) {
    throw InputError(sequence->info().name + ": has " + std::to_string(sequence->size()) +
                     " frames; there is no frame " + std::to_string(start) + " to start with");
  }
  return std::make_unique<PartOfSequence>(std::move(sequence), start, every, limit);
}

}  // namespace hybrid_slam
