#pragma once

#include <cstdint>
#include <vector>

#include "backend/backend.h"
#include "test/support/random.h"

namespace hybrid_slam {

// A stereo pair goes along a wall. Between keyframes kWeak - 1 and kWeak nearly everything changes:
// a few landmarks alone are seen from both sides, and odometry, good to millimetres.
struct WeakGround {
  static constexpr std::size_t kKeyframes = 8;
  static constexpr std::size_t kWeak = 4;
  static constexpr double kNoise = 0.4;               // of a measurement [px]
  static constexpr double kTranslationSigma = 0.005;  // of odometry [m]
  static constexpr double kRotationSigma = 0.003;     // [rad]
  static constexpr std::size_t kOdometerMatches = 150;

  int shared = 0;  // landmarks that are seen from both sides
  bool with_odometry = true;
  std::uint64_t seed = 0;
};

// The covariance of its odometry.
Matrix6d weak_ground_covariance();

// A map of it that the smoother improved after each keyframe. Its odometry is off as its covariance
// says, and all landmarks that are shared are right.
class GrownWeakGround {
 public:
  GrownWeakGround(const WeakGround& options, Backend& backend);

  // Squared distance of the motion across the weak place from the true one, in standard deviations
  // of the odometry.
  double mahalanobis2(const MapSnapshot& map) const;

 private:
  void add_keyframe(std::size_t index, Backend& backend);
  std::vector<Eigen::Vector3d> new_points(std::size_t index);

  WeakGround options_;
  Random random_;
  std::vector<Rigid3d> truth_;  // cam_from_world
  std::vector<KeyframeId> keyframes_;
  std::vector<Eigen::Vector3d> points_;  // in the world
  std::vector<LandmarkId> landmarks_;    // one per point; invalid before it is born
  std::vector<std::size_t> born_at_;     // one per point: keyframe
  std::vector<char> shared_;             // one per point: seen across the weak place
};

}  // namespace hybrid_slam
