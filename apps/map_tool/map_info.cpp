#include "apps/map_tool/map_info.h"

#include <algorithm>
#include <numeric>
#include <set>

namespace hybrid_slam {
namespace {

constexpr int kStrong = 15;           // landmarks in common
constexpr std::size_t kWellSeen = 3;  // keyframes
constexpr double kCellsPerDistance = 20;

void extend(TimeSpan& span, double time, bool first) {
  span.first = first ? time : std::min(span.first, time);
  span.last = first ? time : std::max(span.last, time);
}

std::vector<MapCameraInfo> cameras_of(const MapSnapshot& map) {
  std::vector<MapCameraInfo> cameras(map.camera_count());
  std::vector<std::set<LandmarkId>> seen(cameras.size());
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    MapCameraInfo& camera = cameras[keyframe.observations->camera.value];
    extend(camera.time, keyframe.observations->time, camera.keyframes == 0);
    ++camera.keyframes;
    camera.features += keyframe.observations->size();
    for (const LandmarkId landmark : keyframe.landmarks) {
      if (landmark.valid()) seen[keyframe.observations->camera.value].insert(landmark);
    }
  }
  const std::vector<ResidualSummary> residuals = residuals_by_camera(map);
  for (std::uint32_t i = 0; i < cameras.size(); ++i) {
    cameras[i].camera = map.camera(CameraId(i));
    cameras[i].correction = map.correction(CameraId(i));
    cameras[i].landmarks = seen[i].size();
    cameras[i].residuals = residuals[i];
  }
  return cameras;
}

double median_of(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// What is gathered of a component's landmarks.
struct Ground {
  std::vector<Eigen::Vector3d> all, well_seen;
  std::vector<double> distances;
};

void add_keyframe(const MapSnapshot& map, const Keyframe& keyframe,
                  std::map<KeyframeId, KeyframeId>& last, MapComponentInfo& component) {
  const std::size_t before =
      std::accumulate(component.keyframes.begin(), component.keyframes.end(), std::size_t{0});
  extend(component.time, keyframe.observations->time, before == 0);
  ++component.keyframes[keyframe.observations->camera.value];
  if (!(baseline(map.camera(keyframe)) > 0)) return;
  const auto [previous, first] = last.try_emplace(keyframe.component, keyframe.id);
  if (!first) {
    component.way += (origin_in_a(map.at(previous->second).cam_from_world) -
                      origin_in_a(keyframe.cam_from_world))
                         .norm();
    previous->second = keyframe.id;
  }
}

std::vector<MapComponentInfo> components_of(const MapSnapshot& map) {
  std::map<KeyframeId, MapComponentInfo> components;
  std::map<KeyframeId, KeyframeId> last;
  for (const KeyframeId id : map.keyframe_ids()) {
    MapComponentInfo& component = components[map.at(id).component];
    component.name = map.at(id).component;
    component.keyframes.resize(map.camera_count());
    add_keyframe(map, map.at(id), last, component);
  }
  std::map<KeyframeId, Ground> grounds;
  for (const LandmarkId id : map.landmark_ids()) {
    const Landmark& landmark = map.at(id);
    Ground& ground = grounds[map.at(landmark.reference).component];
    ground.all.push_back(landmark.point_in_world);
    if (landmark.observations.size() >= kWellSeen) ground.well_seen.push_back(ground.all.back());
    for (const Observation& o : landmark.observations) {
      ground.distances.push_back(
          (map.at(o.keyframe).cam_from_world * landmark.point_in_world).norm());
    }
  }
  std::vector<MapComponentInfo> result;
  for (auto& [name, component] : components) {
    Ground& ground = grounds[name];
    component.landmarks = ground.all.size();
    component.distance = median_of(ground.distances);
    component.area = covered_area(ground.well_seen.size() < 3 ? ground.all : ground.well_seen,
                                  component.distance / kCellsPerDistance);
    result.push_back(std::move(component));
  }
  return result;
}

// Whether a keyframe of this camera between two of its keyframes shares no landmark with either.
bool was_away(const std::vector<KeyframeId>& of_camera, const Keyframe& a, const Keyframe& b) {
  const auto shares = [](const Keyframe& keyframe, KeyframeId other) {
    return std::binary_search(
        keyframe.covisible.begin(), keyframe.covisible.end(), Covisible{other, 0},
        [](const Covisible& one, const Covisible& two) { return one.id < two.id; });
  };
  const auto begin = std::upper_bound(of_camera.begin(), of_camera.end(), a.id);
  const auto end = std::lower_bound(begin, of_camera.end(), b.id);
  return std::any_of(begin, end, [&](KeyframeId id) { return !shares(a, id) && !shares(b, id); });
}

MapEdgeInfo edges_of(const MapSnapshot& map) {
  MapEdgeInfo edges;
  std::vector<std::vector<KeyframeId>> of_camera(map.camera_count());
  for (const KeyframeId id : map.keyframe_ids()) {
    of_camera[map.at(id).observations->camera.value].push_back(id);
  }
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    const CameraId camera = keyframe.observations->camera;
    edges.kept += keyframe.keep ? 1 : 0;
    if (keyframe.odometry) ++(is_loose(*keyframe.odometry) ? edges.loose : edges.odometry);
    for (const Covisible& other : keyframe.covisible) {
      if (!(id < other.id)) continue;
      ++edges.covisible;
      if (other.shared_landmarks < kStrong) continue;
      ++edges.strong;
      const Keyframe& there = map.at(other.id);
      if (there.observations->camera != camera) continue;
      edges.returns += was_away(of_camera[camera.value], keyframe, there) ? 1 : 0;
    }
  }
  return edges;
}

}  // namespace

MapInfo map_info(const MapSnapshot& map, const MapFileInfo& file) {
  MapInfo info;
  info.file = file;
  info.keyframes = map.keyframe_count();
  info.landmarks = map.landmark_count();
  info.erased_keyframes = map.next_keyframe_id().value - info.keyframes;
  for (const LandmarkId id : map.landmark_ids()) {
    info.observations += map.at(id).observations.size();
  }
  info.cameras = cameras_of(map);
  info.components = components_of(map);
  info.edges = edges_of(map);
  return info;
}

}  // namespace hybrid_slam
