#include "frontend/odometry/odometry_chain.h"

#include <algorithm>
#include <utility>

namespace hybrid_slam {

std::shared_ptr<const Odometry> OdometryChain::odometry(KeyframeId previous) const {
  if (!since_ || !last_ || !previous.valid()) return nullptr;
  Odometry made{previous, *since_, {}, static_cast<std::uint32_t>(last_->patches)};
  made.keypoints.reserve(last_->inliers.size());
  for (const CircularMatch& match : last_->inliers) {
    made.keypoints.push_back(static_cast<std::uint32_t>(match.current));
  }
  std::sort(made.keypoints.begin(), made.keypoints.end());
  return std::make_shared<const Odometry>(std::move(made));
}

}  // namespace hybrid_slam
