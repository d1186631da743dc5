#include "test/integration/simulated_source.h"

#include "cameras/input_error.h"

namespace hybrid_slam {
namespace {

class SimulatedLoader final : public FrameLoader {
 public:
  explicit SimulatedLoader(const SimulatedSource& source) : source_(source) {}

  Frame load(std::size_t index, StageTimes&) override {
    if (source_.corrupt.contains(index)) {
      throw InputError("frame " + std::to_string(index) + ": made unreadable by the test");
    }
    const FrameObservations& observations = *source_.scene().frames[index].observations;
    StereoFeatures features;
    features.left.kind = features.right.kind = observations.features.kind;
    if (!source_.blank.contains(index)) {
      features = stereo_features(observations);
    }
    return make_frame(observations.frame_index, observations.time, std::move(features),
                      source_.camera().width, source_.camera().height);
  }

 private:
  const SimulatedSource& source_;
};

}  // namespace

std::unique_ptr<FrameLoader> SimulatedSource::make_loader() const {
  return std::make_unique<SimulatedLoader>(*this);
}

StereoFeatures stereo_features(const FrameObservations& observations) {
  StereoFeatures features;
  features.left = observations.features;
  features.u_right = observations.u_right;
  features.right.kind = features.left.kind;
  features.right_of_left.assign(features.left.size(), -1);
  for (std::size_t i = 0; i < features.left.size(); ++i) {
    if (observations.has_right(i)) {
      features.right_of_left[i] = static_cast<int>(features.right.size());
      Keypoint right = features.left.keypoints[i];
      right.x = observations.u_right[i];
      features.right.keypoints.push_back(right);
      features.right.descriptors.push_back(features.left.descriptors[i]);
    }
  }
  return features;
}

}  // namespace hybrid_slam
