#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "backend/map/map_snapshot.h"
#include "frontend/calibration/noise_floor.h"
#include "frontend/matching/image_pyramid.h"
#include "frontend/matching/patch_alignment.h"
#include "frontend/tracking/frame.h"
#include "frontend/tracking/shading_calibrator.h"

namespace hybrid_slam {

struct TrackRefinementOptions {
  bool enabled = true;
  int keyframes = 30;              // of which the images are kept as references, newest
  double sigma = 0.06;             // standard deviation of an aligned position [keypoint scales]
  double min_sigma = 0.1;          // and at least this [px]
  double max_view_angle_deg = 35;  // between the two views of a patch
  AlignmentOptions alignment;
  ShadingCalibratorOptions shading;  // of stereo pairs alone

  // Small patches: lamps that move along with the camera shade the ground anew from every place,
  // and what is large in an image is shifted by that most.
  TrackRefinementOptions() { alignment.half_size = 4; }

  std::string validate() const;
};

// Moves the keypoints that were matched to landmarks to where the image looks like the patch around
// the landmark's first observation: all frames then measure the very same point, to a small part of
// a pixel, which SIFT's own positions do not. A stereo pair's are freed of what its lamps pretend,
// as far as it is known (see ShadingCalibrator).
class TrackRefiner {
 public:
  // `shading`: what an earlier run has found of it; see ShadingCalibrator.
  TrackRefiner(CameraId camera_id, const Camera& camera, const TrackRefinementOptions& options,
               const std::optional<FoundParameter>& shading = std::nullopt);

  // The frame becomes a keyframe: its image can serve as reference.
  void remember(const Frame& frame);

  // Lets go of the images of keyframes that were culled: a vehicle that hovers makes many.
  void forget_culled(const MapSnapshot& map);

  // Looks at a tracked frame for what its tracks tell of the shading, if it is far enough from the
  // last one that was looked at for its tracks to be others.
  void learn_shading(const MapSnapshot& map, const Frame& frame);

  // Aligns the frame's matched keypoints, given a pose good to about a pixel. Changes their
  // positions, right coordinates and standard deviations. Returns how many.
  int refine(const MapSnapshot& map, Frame& frame);

  // What aligned positions are off by besides; null: nothing.
  void use_floor(std::shared_ptr<const NoiseFloor> floor) { floor_ = std::move(floor); }

  // In use now; see ShadingCalibrator.
  double shading() const { return shading_.depth_per_size(); }
  const RunningEstimate& shading_estimate() const { return shading_.estimate(); }

  // What it leaves open for the last tracked frame; nothing of one without aligned keypoints.
  ShadingDoubt shading_doubt() const { return shading_.doubt(size_); }

 private:
  struct Reference;

  // Of which image a patch is, and around what.
  using PatchKey = std::tuple<std::int64_t, float, float, float>;  // frame index, x, y, scale
  using Patches = std::map<PatchKey, std::optional<ReferencePatch>>;

  const ImagePyramid* image_of(std::int64_t frame_index) const;
  bool is_news(const MapSnapshot& map, const Frame& frame) const;
  bool find_reference(const MapSnapshot& map, const Landmark& landmark, Reference& reference) const;
  bool refine_keypoint(const MapSnapshot& map, const Landmark& landmark, std::size_t index,
                       Frame& frame, Patches& patches);
  const std::optional<ReferencePatch>& patch_of(const Reference& reference, Patches& patches);
  Eigen::Vector2d shading_shift(const Rigid3d& target_from_reference,
                                const Eigen::Vector3d& point_in_reference, double scale) const;

  CameraId camera_id_;
  Camera camera_;
  TrackRefinementOptions options_;
  double focal_ = 0;  // of a stereo pair [px], else 0
  ShadingCalibrator shading_;
  double size_ = 0;  // median of the last tracked frame's aligned keypoints [rad]
  std::shared_ptr<const NoiseFloor> floor_;
  std::optional<Eigen::Vector3d> learnt_at_;  // where the last frame that was looked at stood
  std::deque<std::pair<std::int64_t, std::shared_ptr<const ImagePyramid>>>
      images_;       // by frame index, ascending; null where the keyframe was culled
  Patches patches_;  // that the last frame was aligned with: the next mostly needs the same
};

}  // namespace hybrid_slam
