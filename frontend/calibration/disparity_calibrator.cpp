#include "frontend/calibration/disparity_calibrator.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

namespace hybrid_slam {
namespace {

constexpr double kShareOfPair = 0.5;  // each keyframe, and its noise, is in two pairs
// From where the estimate of the noise begins: half of what keypoints claim, a seventh of a pixel.
const SightNoise kFirstNoise(0.25, 0.25, 0.02);

// Lamps that move along with the camera change what bumps look like, and hold features back by so
// much of their motion. Nothing at zero disparity, where the offset shows by itself.
constexpr double kMotionError = 0.002;

// Of an offset that is as far off as keypoints claim to be: matches weigh otherwise then.
constexpr int kMaxSteps = 8;
// Of what an offset in use is off by, the share that a map which was judged with it hides.
constexpr double kSelected = 0.4;

std::vector<StereoSight> corrected(std::span<const StereoSight> sights, double offset) {
  std::vector<StereoSight> result(sights.begin(), sights.end());
  for (StereoSight& sight : result) {
    sight.previous.z() -= offset;
    sight.current.z() -= offset;
  }
  return result;
}

std::vector<double> disparities(std::span<const StereoSight> sights, double offset) {
  std::vector<double> result;
  for (const StereoSight& sight : sights) {
    result.push_back(sight.previous.x() - (sight.previous.z() - offset));
  }
  return result;
}

// What may shift the offset in every pair alike: noise of unknown ratio, and errors of the motion
// seen, from the farthest tenth of the points on to zero disparity.
double shift_by_model(std::vector<double> disparities, double noise_variance) {
  const auto count = static_cast<double>(disparities.size());
  double mean = 0;
  for (const double d : disparities) mean += d / count;
  double variance = 0;
  for (const double d : disparities) variance += (d - mean) * (d - mean) / count;
  const auto far = disparities.begin() + static_cast<long>(disparities.size() / 10);
  std::nth_element(disparities.begin(), far, disparities.end());
  return mean * noise_variance / std::max(variance, noise_variance) + kMotionError * *far;
}

// The mean, weighted as the sights are, of what their keypoints claim.
double mean_variance(std::span<const StereoSight> sights) {
  double weights = 0;
  for (const StereoSight& sight : sights) weights += 1 / sight.previous_variance;
  return static_cast<double>(sights.size()) / weights;
}

double median_variance(std::span<const StereoSight> sights) {
  std::vector<double> variances;
  for (const StereoSight& sight : sights) variances.push_back(sight.previous_variance);
  const auto middle = variances.begin() + static_cast<long>(variances.size() / 2);
  std::nth_element(variances.begin(), middle, variances.end());
  return *middle;
}

// Of one coordinate: the mean over all three.
double mean_noise(const SightNoise& noise, std::span<const StereoSight> sights) {
  return (mean_variance(sights) * (noise[0] + noise[1]) + noise[2]) / 3;
}

std::optional<std::uint32_t> keypoint_in(const Landmark& landmark, KeyframeId keyframe) {
  const Observation first{keyframe, 0};
  const auto seen =
      std::lower_bound(landmark.observations.begin(), landmark.observations.end(), first);
  if (seen == landmark.observations.end() || seen->keyframe != keyframe) return std::nullopt;
  return seen->keypoint;
}

// As it was measured.
Eigen::Vector3d measured(const FrameObservations& frame, std::size_t keypoint) {
  const Keypoint& left = frame.features.keypoints[keypoint];
  return {left.x, left.y, frame.u_right[keypoint] + frame.disparity_offset.value()};
}

double variance_of(const FrameObservations& frame, std::size_t keypoint) {
  const double sigma = frame.features.keypoints[keypoint].sigma;
  return sigma * sigma;
}

std::vector<StereoSight> seen_by_both(const MapSnapshot& map, const Keyframe& previous,
                                      const Keyframe& current) {
  const FrameObservations& before = *previous.observations;
  const FrameObservations& now = *current.observations;
  std::vector<StereoSight> sights;
  for (std::size_t i = 0; i < now.size(); ++i) {
    const Landmark* landmark =
        current.landmarks[i].valid() ? map.find(current.landmarks[i]) : nullptr;
    if (landmark == nullptr || !now.has_right(i)) continue;
    const auto j = keypoint_in(*landmark, previous.id);
    if (!j || !before.has_right(*j)) continue;
    sights.push_back(
        {measured(before, *j), measured(now, i), variance_of(before, *j), variance_of(now, i)});
  }
  return sights;
}

// The keyframe before it that sees much of the same; null if there is none.
const Keyframe* one_before(const MapSnapshot& map, const Keyframe& keyframe, int min_shared) {
  const CameraId camera = keyframe.observations->camera;
  for (auto other = keyframe.covisible.rbegin(); other != keyframe.covisible.rend(); ++other) {
    if (!(other->id < keyframe.id) || other->shared_landmarks < min_shared) continue;
    const Keyframe& before = map.at(other->id);
    if (before.observations->camera == camera && before.observations->disparity_offset) {
      return &before;
    }
  }
  return nullptr;
}

}  // namespace

std::string DisparityCalibratorOptions::validate() const {
  if (!(prior_sigma > 0)) return "prior_sigma must be positive";
  if (!(min_significance >= 0)) return "min_significance must not be negative";
  if (min_matches < 7) return "min_matches must be at least 7";
  return {};
}

DisparityCalibrator::DisparityCalibrator(CameraId camera_id,
                                         const Calibrated<RectifiedStereo>& camera,
                                         const DisparityCalibratorOptions& options,
                                         const std::optional<FoundParameter>& start)
    : camera_id_(camera_id),
      camera_(camera),
      options_(options),
      estimate_(options.prior_sigma, kShareOfPair, options.min_significance,
                options.enabled ? start : std::nullopt),
      noise_(kFirstNoise) {
  const std::string error = options.validate();
  if (!error.empty()) throw std::invalid_argument("disparity calibrator: " + error);
}

void DisparityCalibrator::follow(const MapSnapshot& map) {
  if (!options_.enabled || !(next_ < map.next_keyframe_id())) return;
  const Keyframe* const newest = map.newest_keyframe(camera_id_);
  if (newest == nullptr) return;
  for (const KeyframeId id : map.keyframe_ids_from(next_)) {
    if (!(id < newest->id)) break;
    const Keyframe& keyframe = map.at(id);
    const FrameObservations& seen = *keyframe.observations;
    if (seen.camera == camera_id_ && seen.disparity_offset) add(map, keyframe);
    if (std::exchange(judges_anew_, false)) {
      next_ = first_ = map.next_keyframe_id();
      return;
    }
  }
  next_ = std::max(next_, newest->id);
}

void DisparityCalibrator::add(const MapSnapshot& map, const Keyframe& keyframe) {
  const Keyframe* const before = one_before(map, keyframe, options_.min_matches);
  if (before == nullptr || before->id < first_) return;
  add(seen_by_both(map, *before, keyframe),
      keyframe.cam_from_world * inverse(before->cam_from_world));
}

void DisparityCalibrator::add(std::span<const StereoSight> sights,
                              const Rigid3d& current_from_previous) {
  if (!options_.enabled || static_cast<int>(sights.size()) < options_.min_matches) return;
  const double far = std::sqrt(median_variance(sights));
  const double least_information = 1 / (options_.prior_sigma * options_.prior_sigma);
  double at = estimate_.value_now();
  std::optional<DisparityOffsetFit> fit;
  for (int step = 0; step < kMaxSteps; ++step) {
    const Rigid3d& start = fit ? fit->motion : current_from_previous;
    fit = fit_disparity_offset(camera_.params, start, noise_, corrected(sights, at));
    if (!fit) return;
    noise_ = fit->noise;
    if (!(fit->information > 0)) return;
    at += fit->offset;
    if (std::abs(fit->offset) < far || !(fit->information > least_information)) break;
  }
  const double before = offset();
  estimate_.add(at, fit->information,
                shift_by_model(disparities(sights, at), mean_noise(fit->noise, sights)));
  // The map throws out what contradicts the offset in use by more than keypoints claim to be off,
  // which pulls what is left towards it. Where that was far off, keyframes before count little.
  const double change = std::abs(offset() - before);
  if (change > 0) estimate_.doubt(kSelected * change);
  judges_anew_ = change > far;
}

}  // namespace hybrid_slam
