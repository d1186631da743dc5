#include "test/integration/simulated_source.h"

#include "cameras/input_error.h"
#include "test/support/stereo_frame.h"

namespace hybrid_slam {
namespace {

class SimulatedLoader final : public FrameLoader {
 public:
  explicit SimulatedLoader(const SimulatedSource& source) : source_(source) {}

  Frame load(std::size_t index, StageTimes&) override {
    if (source_.corrupt.contains(index)) {
      throw InputError("frame " + std::to_string(index) + ": made unreadable by the test");
    }
    Frame frame = stereo_frame(source_.scene(), index);
    if (source_.blank.contains(index)) {
      StereoFeatures none;
      none.left.kind = none.right.kind = frame.features.left.kind;
      frame = make_frame(frame.index, frame.time, std::move(none), source_.camera().width,
                         source_.camera().height);
    }
    return frame;
  }

 private:
  const SimulatedSource& source_;
};

}  // namespace

std::unique_ptr<FrameLoader> SimulatedSource::make_loader() const {
  return std::make_unique<SimulatedLoader>(*this);
}

}  // namespace hybrid_slam
