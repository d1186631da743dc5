#include "apps/io/hybrid_error.h"

#include <map>
#include <vector>

namespace hybrid_slam {

std::optional<HybridError> hybrid_error(std::span<const StampedPose> stereo,
                                        std::span<const StampedPose> fisheye,
                                        std::span<const StampedPose> true_stereo,
                                        std::span<const StampedPose> true_fisheye,
                                        double max_difference) {
  HybridError error;
  error.total = true_fisheye.size();
  const std::vector<PosePair> of_fisheye = associate(fisheye, true_fisheye, max_difference);
  error.registered = of_fisheye.size();
  std::map<double, const PosePair*> of_stereo;  // by time
  const std::vector<PosePair> stereo_pairs = associate(stereo, true_stereo, max_difference);
  for (const PosePair& pair : stereo_pairs) of_stereo[pair.time] = &pair;
  std::vector<double> translations;
  std::vector<double> rotations;
  for (const PosePair& fish : of_fisheye) {
    const auto nearest = of_stereo.lower_bound(fish.time - max_difference);
    if (nearest == of_stereo.end() || nearest->first > fish.time + max_difference) continue;
    const Rigid3d estimate = inverse(nearest->second->estimate) * fish.estimate;
    const Rigid3d truth = inverse(nearest->second->truth) * fish.truth;
    translations.push_back((estimate.translation() - truth.translation()).norm());
    rotations.push_back(truth.rotation().angularDistance(estimate.rotation()));
  }
  if (translations.empty()) return std::nullopt;
  error.translation = error_statistics(std::move(translations));
  error.rotation = error_statistics(std::move(rotations));
  return error;
}

}  // namespace hybrid_slam
