#include "frontend/tracking/track_refinement.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "frontend/pose/pose_belief.h"

namespace hybrid_slam {
namespace {

// Between two frames that tell of the shading, over the scene's median depth: a landmark lasts for
// about half of a view, as wide as the scene is deep, and so tells five times (the share of a track
// that ShadingCalibrator counts).
constexpr double kLearningStep = 0.1;

// Pixel offsets between two views of a small plane at a point, seen head-on by the reference: what
// a step of one reference pixel becomes in the target.
std::optional<Eigen::Matrix2d> patch_warp(const Camera& camera,
                                          const Rigid3d& target_from_reference,
                                          const Eigen::Vector2d& reference_pixel,
                                          const Eigen::Vector3d& point_in_reference) {
  constexpr double kStep = 3;  // [px]
  const Eigen::Vector3d normal = point_in_reference.normalized();
  const double distance = point_in_reference.norm();
  Eigen::Matrix2d warp;
  for (int axis = 0; axis < 2; ++axis) {
    Eigen::Vector2d ends[2];
    for (int side = 0; side < 2; ++side) {
      Eigen::Vector2d pixel = reference_pixel;
      pixel[axis] += side == 0 ? -kStep : kStep;
      const auto ray = unproject(camera, pixel);
      if (!ray || ray->dot(normal) < 0.1) {
        return std::nullopt;
      }
      const auto seen = project(
          camera, target_from_reference * Eigen::Vector3d(*ray * (distance / ray->dot(normal))));
      if (!seen) {
        return std::nullopt;
      }
      ends[side] = *seen;
    }
    warp.col(axis) = (ends[1] - ends[0]) / (2 * kStep);
  }
  return warp;
}

// Median of the aligned keypoints; 0 without any.
double median_scale(const Frame& frame) {
  std::vector<double> scales;
  for (const std::size_t i : frame.aligned) {
    scales.push_back(double{frame.features.left.keypoints[i].scale});
  }
  return median_of(std::move(scales));
}

}  // namespace

struct TrackRefiner::Reference {
  const ImagePyramid* image = nullptr;
  const Keyframe* keyframe = nullptr;
  const Keypoint* keypoint = nullptr;
  float u_right = kNoRightMatch;
};

std::string TrackRefinementOptions::validate() const {
  if (keyframes < 1 || !(sigma > 0) || !(min_sigma > 0) || !(max_view_angle_deg > 0)) {
    return "refinement: keyframes, sigma, min_sigma and max_view_angle_deg must be positive";
  }
  for (const std::string& error : {alignment.validate(), shading.validate()}) {
    if (!error.empty()) return "refinement: " + error;
  }
  return {};
}

TrackRefiner::TrackRefiner(CameraId camera_id, const Camera& camera,
                           const TrackRefinementOptions& options,
                           const std::optional<FoundParameter>& shading)
    : camera_id_(camera_id),
      camera_(camera),
      options_(options),
      shading_(options.shading, shading) {
  if (const auto* stereo = std::get_if<Calibrated<RectifiedStereo>>(&camera)) {
    focal_ = stereo->params[0];
  }
}

void TrackRefiner::remember(const Frame& frame) {
  if (!options_.enabled || !frame.image) {
    return;
  }
  images_.emplace_back(frame.index, frame.image);
  if (images_.size() > static_cast<std::size_t>(options_.keyframes)) {
    images_.pop_front();
  }
}

void TrackRefiner::forget_culled(const MapSnapshot& map) {
  if (camera_id_.value >= map.camera_count()) return;
  const std::int64_t taken_in = map.newest_frame_index(camera_id_);  // later ones are on their way
  for (auto& [index, image] : images_) {
    if (index <= taken_in && map.find_frame(camera_id_, index) == nullptr) image.reset();
  }
}

const ImagePyramid* TrackRefiner::image_of(std::int64_t frame_index) const {
  const auto at =
      std::lower_bound(images_.begin(), images_.end(), frame_index,
                       [](const auto& entry, std::int64_t index) { return entry.first < index; });
  return at != images_.end() && at->first == frame_index ? at->second.get() : nullptr;
}

// The oldest observation whose image is still here.
bool TrackRefiner::find_reference(const MapSnapshot& map, const Landmark& landmark,
                                  Reference& reference) const {
  for (const Observation& observation : landmark.observations) {
    const Keyframe& keyframe = map.at(observation.keyframe);
    if (keyframe.observations->camera != camera_id_) {
      continue;
    }
    reference.image = image_of(keyframe.observations->frame_index);
    if (reference.image != nullptr) {
      reference.keyframe = &keyframe;
      reference.keypoint = &keyframe.observations->features.keypoints[observation.keypoint];
      if (keyframe.observations->has_right(observation.keypoint)) {
        reference.u_right = keyframe.observations->u_right[observation.keypoint];
      }
      return true;
    }
  }
  return false;
}

// The patch around a reference, made anew unless the last frame had it. Goes to `patches`.
const std::optional<ReferencePatch>& TrackRefiner::patch_of(const Reference& reference,
                                                            Patches& patches) {
  const Keypoint& at = *reference.keypoint;
  const PatchKey key(reference.keyframe->observations->frame_index, at.x, at.y, at.scale);
  auto kept = patches_.extract(key);
  if (!kept.empty()) return patches.insert(std::move(kept)).position->second;
  const auto [place, is_new] = patches.try_emplace(key);
  if (is_new) {
    place->second = make_reference_patch(*reference.image, double{at.x}, double{at.y},
                                         double{at.scale}, options_.alignment);
  }
  return place->second;
}

bool TrackRefiner::refine_keypoint(const MapSnapshot& map, const Landmark& landmark,
                                   std::size_t index, Frame& frame, Patches& patches) {
  Reference reference;
  if (!find_reference(map, landmark, reference)) {
    return false;
  }
  const Rigid3d target_from_reference =
      frame.cam_from_world * inverse(reference.keyframe->cam_from_world);
  const Eigen::Vector3d point_in_reference =
      reference.keyframe->cam_from_world * landmark.point_in_world;
  const Eigen::Vector3d point_in_target = target_from_reference * point_in_reference;
  const double view_cosine = (target_from_reference.rotation() * point_in_reference)
                                 .normalized()
                                 .dot(point_in_target.normalized());
  if (view_cosine < std::cos(options_.max_view_angle_deg * std::numbers::pi / 180)) {
    return false;
  }
  const Eigen::Vector2d center(reference.keypoint->x, reference.keypoint->y);
  const auto warp = patch_warp(camera_, target_from_reference, center, point_in_reference);
  if (!warp) return false;
  const auto& patch = patch_of(reference, patches);
  if (!patch) return false;
  Keypoint& keypoint = frame.features.left.keypoints[index];
  const Alignment aligned = align_patch(
      *patch, *frame.image, *warp, Eigen::Vector2d(keypoint.x, keypoint.y), options_.alignment);
  if (!aligned.converged) {
    return false;
  }
  const Eigen::Vector2d position =
      aligned.position + shading_shift(target_from_reference, point_in_reference,
                                       static_cast<double>(reference.keypoint->scale));
  const auto shift = static_cast<float>(position.x()) - keypoint.x;
  keypoint.x += shift;
  keypoint.y = static_cast<float>(position.y());
  keypoint.sigma = std::max(static_cast<float>(options_.min_sigma),
                            static_cast<float>(options_.sigma) * reference.keypoint->scale);
  if (floor_) keypoint.sigma = floor_->over(keypoint.sigma, keypoint.x, keypoint.y);
  if (!frame.features.u_right.empty()) {
    frame.features.u_right[index] += shift;  // the disparity stays
  }
  return true;
}

// From where the patch is seen to where the ground is: it moved as if it lay deeper.
Eigen::Vector2d TrackRefiner::shading_shift(const Rigid3d& target_from_reference,
                                            const Eigen::Vector3d& point_in_reference,
                                            double scale) const {
  const double depth =
      focal_ > 0 ? ShadingCalibrator::relative_depth(shading(), scale / focal_) : 0;
  if (depth == 0) return Eigen::Vector2d::Zero();
  const auto ground = project(camera_, target_from_reference * point_in_reference);
  const auto seen =
      project(camera_, target_from_reference * Eigen::Vector3d((1 + depth) * point_in_reference));
  return ground && seen ? Eigen::Vector2d(*ground - *seen) : Eigen::Vector2d::Zero();
}

int TrackRefiner::refine(const MapSnapshot& map, Frame& frame) {
  frame.aligned.clear();
  if (!options_.enabled || !frame.image) {
    return 0;
  }
  Patches patches;
  for (std::size_t i = 0; i < frame.landmarks.size(); ++i) {
    const Landmark* landmark = frame.landmarks[i].valid() ? map.find(frame.landmarks[i]) : nullptr;
    if (landmark != nullptr && refine_keypoint(map, *landmark, i, frame, patches)) {
      frame.aligned.push_back(i);
    }
  }
  patches_ = std::move(patches);
  return static_cast<int>(frame.aligned.size());
}

void TrackRefiner::learn_shading(const MapSnapshot& map, const Frame& frame) {
  if (focal_ == 0) return;
  size_ = median_scale(frame) / focal_;
  if (!is_news(map, frame)) return;
  learnt_at_ = inverse(frame.cam_from_world).translation();
  const auto& stereo = std::get<Calibrated<RectifiedStereo>>(camera_);
  std::vector<ShadedTrack> tracks;
  for (const std::size_t i : frame.aligned) {
    const Landmark* landmark = frame.landmarks[i].valid() ? map.find(frame.landmarks[i]) : nullptr;
    Reference reference;
    if (landmark == nullptr || !find_reference(map, *landmark, reference)) continue;
    const Rigid3d& reference_from_world = reference.keyframe->cam_from_world;
    tracks.push_back(make_shaded_track(stereo, frame.cam_from_world * inverse(reference_from_world),
                                       *reference.keypoint, reference.u_right,
                                       frame.features.left.keypoints[i],
                                       (reference_from_world * landmark->point_in_world).z()));
  }
  shading_.add(tracks, shading());
}

// Whether the frame has aligned tracks, and stands far enough from the last one that was looked at.
bool TrackRefiner::is_news(const MapSnapshot& map, const Frame& frame) const {
  std::vector<double> depths;
  for (const std::size_t i : frame.aligned) {
    const Landmark* landmark = frame.landmarks[i].valid() ? map.find(frame.landmarks[i]) : nullptr;
    if (landmark == nullptr) continue;
    depths.push_back((frame.cam_from_world * landmark->point_in_world).z());
  }
  if (depths.empty()) return false;
  const Eigen::Vector3d place = inverse(frame.cam_from_world).translation();
  return !learnt_at_ ||
         (place - *learnt_at_).norm() >= kLearningStep * median_of(std::move(depths));
}

}  // namespace hybrid_slam
