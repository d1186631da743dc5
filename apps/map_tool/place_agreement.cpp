#include "apps/map_tool/place_agreement.h"

#include <set>

#include "cameras/geometry/se3.h"

namespace hybrid_slam {
namespace {

// A place by its ends in two components.
struct Ends {
  KeyframeId one, other;
  Sim3d one_from_other;
};

Ends ends_from(const MapSnapshot& map, const LoopMeasurement& loop, KeyframeId component) {
  if (map.at(loop.keyframe).component == component) {
    return {loop.keyframe, loop.match, loop.keyframe_from_match};
  }
  return {loop.match, loop.keyframe, inverse(loop.keyframe_from_match)};
}

// By the map.
Rigid3d motion(const MapSnapshot& map, KeyframeId a, KeyframeId b) {
  return map.at(a).cam_from_world * inverse(map.at(b).cam_from_world);
}

std::set<LandmarkId> older_landmarks(const LoopMeasurement& loop) {
  std::set<LandmarkId> ids;
  for (const LandmarkMerge& merge : loop.same) ids.insert(merge.keep);
  for (const LandmarkObservation& seen : loop.new_observations) ids.insert(seen.landmark);
  return ids;
}

}  // namespace

bool places_agree(const MapSnapshot& map, const LoopMeasurement& a, const LoopMeasurement& b,
                  const LoopClosureOptions& options) {
  const KeyframeId component = map.at(a.keyframe).component;
  const Ends first = ends_from(map, a, component);
  const Ends second = ends_from(map, b, component);
  const Sim3d by_first = Sim3d(motion(map, second.one, first.one)) * first.one_from_other *
                         Sim3d(motion(map, first.other, second.other));
  const Rigid3d off = without_scale(by_first * inverse(second.one_from_other));
  Vector6d covariance = Vector6d::Zero();
  const auto add = [&](KeyframeId to, KeyframeId from, const Sim3d& way) {
    covariance +=
        motion_information(map, to, from, way, options.graph).diagonal().head<6>().cwiseInverse();
  };
  add(second.one, first.one, Sim3d(motion(map, second.one, first.one)));
  add(first.other, second.other, Sim3d(motion(map, first.other, second.other)));
  add(first.one, first.other, first.one_from_other);
  add(second.one, second.other, second.one_from_other);
  const Vector6d error = se3_log(off);
  return error.cwiseAbs2().cwiseQuotient(covariance).sum() <= options.chi2_loop;
}

std::size_t landmarks_of_its_own(const LoopMeasurement& b, const LoopMeasurement& a) {
  std::set<LandmarkId> own = older_landmarks(b);
  for (const LandmarkId id : older_landmarks(a)) own.erase(id);
  return own.size();
}

}  // namespace hybrid_slam
