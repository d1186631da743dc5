#include "apps/io/graphs/map_graph.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>

#include "apps/io/ply.h"
#include "backend/map/map_file.h"
#include "backend/map/map_file_format.h"
#include "backend/problem/map_graph.h"
#include "backend/problem/odometry_constraints.h"

namespace hybrid_slam {

namespace {

namespace fs = std::filesystem;

// Everything, in ascending order.
FactorGraph whole_graph(const MapSnapshot& map) {
  ProblemConfig config;
  config.variable_poses = map.keyframe_ids();
  config.variable_landmarks = map.landmark_ids();
  config.constraints = odometry_constraints(map, config.variable_poses);
  FactorGraph graph = make_graph(map, config).graph;
  for (std::size_t i = 0; i < graph.frames.size(); ++i) {
    graph.frames[i].fixed = config.variable_poses[i] == map.origin();
  }
  return graph;
}

// Empty unless they ascend strictly: cameras that move on their own may share their times.
std::vector<double> times_of(const MapSnapshot& map) {
  std::vector<double> times;
  for (const KeyframeId id : map.keyframe_ids()) times.push_back(map.at(id).observations->time);
  const bool ascend =
      std::adjacent_find(times.begin(), times.end(), std::greater_equal<>()) == times.end();
  return ascend ? times : std::vector<double>();
}

// Only what has moved: the rest stays bit by bit.
void take_estimate(const FactorGraph& graph, Map& map) {
  std::vector<std::pair<KeyframeId, Rigid3d>> poses;
  std::vector<std::pair<LandmarkId, Eigen::Vector3d>> points;
  std::size_t i = 0;
  for (const KeyframeId id : map.view().keyframe_ids()) {
    const Rigid3d& pose = graph.frames[i++].cam_from_world;
    if (pose.params != map.view().at(id).cam_from_world.params) poses.emplace_back(id, pose);
  }
  i = 0;
  for (const LandmarkId id : map.view().landmark_ids()) {
    const Eigen::Vector3d& point = graph.points[i++].in_world;
    if (point != map.view().at(id).point_in_world) points.emplace_back(id, point);
  }
  map.move(poses, points);
}

// Builds a map frame by frame: a landmark is born as soon as enough was seen of it.
class MapMaker {
 public:
  MapMaker(const FactorGraph& graph, const std::vector<double>& times)
      : graph_(graph),
        times_(times),
        seen_(graph.frames.size()),
        landmarks_(graph.points.size()),
        unborn_(graph.points.size()) {
    for (const GraphCamera& camera : graph.cameras) map_.add_camera(camera.camera);
    for (const GraphObservation& o : graph.observations) seen_[o.frame].push_back(&o);
  }

  Map make() {
    for (std::size_t i = 0; i < graph_.frames.size(); ++i) add_frame(i);
    return std::move(map_);
  }

 private:
  bool is_stereo(std::size_t frame) const {
    return std::holds_alternative<Calibrated<RectifiedStereo>>(
        graph_.cameras[graph_.frames[frame].camera].camera);
  }

  std::shared_ptr<const FrameObservations> measured(std::size_t i) const {
    auto made = std::make_shared<FrameObservations>();
    made->camera = CameraId(graph_.frames[i].camera);
    made->frame_index = static_cast<std::int64_t>(i);
    made->time = times_.empty() ? static_cast<double>(i) : times_[i];
    for (const GraphObservation* o : seen_[i]) {
      const Eigen::Vector3f at = o->measurement.cast<float>();
      made->features.keypoints.push_back(
          {.x = at[0], .y = at[1], .scale = 1, .sigma = static_cast<float>(o->sigma)});
      if (is_stereo(i)) made->u_right.push_back(at[2]);
    }
    made->features.descriptors.resize(seen_[i].size());
    return made;
  }

  void add_frame(std::size_t i) {
    NewKeyframe made;
    made.observations = measured(i);
    made.cam_from_world = graph_.frames[i].cam_from_world;
    made.reference = newest_;
    for (const GraphObservation* o : seen_[i]) made.landmarks.push_back(landmarks_[o->point]);
    newest_ = map_.add_keyframe(made);
    MapEdit births;
    for (std::uint32_t k = 0; k < seen_[i].size(); ++k) {
      const std::uint32_t point = seen_[i][k]->point;
      if (!landmarks_[point].valid()) give_birth(point, {newest_, k}, births);
    }
    map_.apply(births);
    const std::vector<LandmarkId>& born = map_.view().at(newest_).landmarks;
    for (std::uint32_t k = 0; k < born.size(); ++k) {
      if (born[k].valid()) landmarks_[seen_[i][k]->point] = born[k];
    }
  }

  void give_birth(std::uint32_t point, const Observation& observation, MapEdit& births) {
    std::vector<Observation>& all = unborn_[point];
    if (!all.empty() && all.back().keyframe == observation.keyframe) return;
    all.push_back(observation);
    const bool has_depth = std::any_of(all.begin(), all.end(), [&](const Observation& o) {
      return map_.view().at(o.keyframe).observations->has_right(o.keypoint);
    });
    if (all.size() > 1 || has_depth) {
      births.new_landmarks.push_back({graph_.points[point].in_world, all});
    }
  }

  const FactorGraph& graph_;
  const std::vector<double>& times_;
  Map map_;
  KeyframeId newest_;
  std::vector<std::vector<const GraphObservation*>> seen_;  // by frame
  std::vector<LandmarkId> landmarks_;                       // by point; invalid: not born yet
  std::vector<std::vector<Observation>> unborn_;            // by point
};

}  // namespace

bool is_map_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::string begin(kMapFileFormat.magic.size(), '\0');
  in.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  return in && begin == kMapFileFormat.magic;
}

GraphFile read_map_graph(const fs::path& path) {
  const auto loaded = std::make_shared<LoadedMap>(load_map(path));
  GraphFile file;
  file.format = GraphFormat::kMap;
  file.map = loaded->map.snapshot();
  file.graph = whole_graph(*file.map);
  for (const KeyframeId id : file.map->keyframe_ids()) {
    file.frame_names.push_back(std::to_string(id.value));
  }
  for (const LandmarkId id : file.map->landmark_ids()) file.point_ids.push_back(id.value);
  file.times = times_of(*file.map);
  file.writers.push_back(
      {GraphFormat::kMap, [loaded](const FactorGraph& graph, const fs::path& folder) {
         take_estimate(graph, loaded->map);
         save_map(folder / "optimized.hslam", loaded->map.view(), loaded->info);
         return folder / "optimized.hslam";
       }});
  file.writers.push_back(
      {GraphFormat::kPly, [loaded](const FactorGraph& graph, const fs::path& folder) {
         take_estimate(graph, loaded->map);
         write_map_ply(folder / "optimized.ply", loaded->map.view());
         return folder / "optimized.ply";
       }});
  return file;
}

std::optional<GraphWriter> make_map_writer(const GraphFile& file) {
  const auto& frames = file.graph.frames;
  if (file.map != nullptr || std::any_of(frames.begin(), frames.end(), [](const auto& frame) {
        return frame.camera == GraphFrame::kNoCamera;
      })) {
    return std::nullopt;
  }
  return GraphWriter{GraphFormat::kMap,
                     [times = file.times](const FactorGraph& graph, const fs::path& folder) {
                       const Map map = MapMaker(graph, times).make();
                       save_map(folder / "optimized.hslam", map.view(), {"map_optimizer", ""});
                       return folder / "optimized.hslam";
                     }};
}

}  // namespace hybrid_slam
