#include "test/integration/simulated_source.h"

#include "cameras/input_error.h"
#include "test/support/stereo_frame.h"

namespace hybrid_slam {
namespace {

Frame without_features(const Frame& frame) {
  StereoFeatures none;
  none.left.kind = none.right.kind = frame.features.left.kind;
  return make_frame(frame.index, frame.time, std::move(none), 64, 64);
}

class SimulatedLoader final : public FrameLoader {
 public:
  explicit SimulatedLoader(const SimulatedSource& source) : source_(source) {}

  FrameSet load(std::size_t index, StageTimes&) override {
    if (source_.corrupt.contains(index)) {
      throw InputError("frame " + std::to_string(index) + ": made unreadable by the test");
    }
    FrameSet frames{stereo_frame(source_.stereo_truth(index), source_.camera()), {}, {}};
    if (source_.blank.contains(index)) frames.stereo = without_features(frames.stereo);
    if (source_.fisheye_missing.contains(index)) {
      frames.fisheye_error = "frame " + std::to_string(index) + ": no fisheye image";
    } else if (source_.fisheye() != nullptr) {
      frames.fisheye = mono_frame(source_.fisheye_truth(index), *source_.fisheye());
      if (source_.fisheye_blank.contains(index)) {
        frames.fisheye = without_features(*frames.fisheye);
      }
    }
    number(index, frames.stereo);
    if (frames.fisheye) number(index, *frames.fisheye);
    return frames;
  }

 private:
  void number(std::size_t index, Frame& frame) const {
    if (source_.order.empty()) return;
    frame.index = static_cast<std::int64_t>(index);
    frame.time = static_cast<double>(index) / source_.scene().options.frame_rate;
  }

  const SimulatedSource& source_;
};

}  // namespace

std::unique_ptr<FrameLoader> SimulatedSource::make_loader() const {
  return std::make_unique<SimulatedLoader>(*this);
}

}  // namespace hybrid_slam
