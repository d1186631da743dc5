#include "test/integration/tracked_scene.h"

#include <Eigen/Cholesky>

#include "backend/backend.h"
#include "cameras/geometry/uncertain_motion.h"
#include "frontend/mapping/culling.h"
#include "frontend/mapping/fusion.h"
#include "frontend/mapping/triangulation.h"
#include "frontend/tracking/fisheye_tracker.h"
#include "frontend/tracking/stereo_tracker.h"
#include "test/support/stereo_frame.h"

namespace hybrid_slam {
namespace {

constexpr int kFeatures = 1000;

class Mapping {
 public:
  explicit Mapping(const SyntheticScene& scene) : backend_(BackendOptions()) {
    for (const Camera& camera : scene.cameras) backend_.add_camera(camera);
  }

  void add(const TrackedFrame& frame) {
    MapEdit counts;
    for (const LandmarkId id : frame.counts.visible) counts.counted.push_back({id, 1, 0});
    for (const LandmarkId id : frame.counts.found) counts.counted.push_back({id, 0, 1});
    backend_.apply(counts);
    if (!frame.keyframe) return;
    const KeyframeId id = backend_.add(*frame.keyframe);
    backend_.apply(probation_.cull(backend_.view(), id));
    backend_.apply(triangulate_with_neighbours(backend_.view(), id, TriangulationOptions()));
    backend_.apply(fuse_with_neighbours(backend_.view(), id, FusionOptions()));
    backend_.optimize_local(id);
    backend_.apply(cull_keyframes(backend_.view(), id, culling_));
  }

  const MapSnapshot& map() const { return backend_.view(); }

 private:
  CullingOptions culling_;
  Backend backend_;
  LandmarkProbation probation_{culling_};
};

template <typename Options>
Options with_features(Options options) {
  options.max_features = kFeatures;
  return options;
}

}  // namespace

TrackedMoment track_scene(const SyntheticScene& scene) {
  const auto& stereo_camera = std::get<Calibrated<RectifiedStereo>>(scene.cameras[0]);
  Mapping mapping(scene);
  StereoTracker stereo(CameraId(0), stereo_camera, with_features(StereoTrackerOptions()));
  std::optional<FisheyeTracker> fisheye;
  if (scene.cameras.size() > 1) {
    fisheye.emplace(CameraId(1), std::get<Calibrated<KannalaBrandt>>(scene.cameras[1]),
                    with_features(FisheyeTrackerOptions()));
  }
  TrackedMoment moment;
  for (std::size_t i = 0; i < scene.frames.size(); i += scene.cameras.size()) {
    moment = {};
    moment.stereo = stereo.track(stereo_frame(scene.frames[i], scene.cameras[0]), mapping.map());
    mapping.add(moment.stereo);
    if (!fisheye) continue;
    moment.fisheye = fisheye->track(mono_frame(scene.frames[i + 1], scene.cameras[1]),
                                    mapping.map(), moment.stereo.reference);
    mapping.add(moment.fisheye);
    if (stereo.uncertain_pose() != nullptr && fisheye->uncertain_pose() != nullptr) {
      moment.left_from_fisheye =
          relative_pose(mapping.map(), *stereo.uncertain_pose(), *fisheye->uncertain_pose());
    }
  }
  const KeyframeId origin = mapping.map().origin();
  moment.known = moment.stereo.covariance_base == origin &&
                 (!fisheye || moment.fisheye.covariance_base == origin);
  return moment;
}

double normalized_error(const UncertainMotion& estimate, const Rigid3d& truth) {
  const Vector6d off = se3_log(truth * inverse(estimate.b_from_a));
  return squared_mahalanobis(off, estimate.covariance) / 6;
}

}  // namespace hybrid_slam
