#include "test/backend/incremental/corridor.h"

#include <cmath>

#include "test/backend/incremental/graph_feed.h"
#include "test/support/random.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

namespace {

constexpr double kNearest = 3;  // ahead of the keyframes that see a landmark [m]
constexpr double kFarthest = 10;
constexpr double kSigma = 0.5;  // [px]

// One step further along a line that sways a little.
Rigid3d keyframe_pose(int index, double step) {
  const double sway = 0.1 * step * index;
  const Eigen::Quaterniond heading(
      Eigen::AngleAxisd(0.05 * std::sin(sway), Eigen::Vector3d::UnitY()));
  return inverse(Rigid3d(heading, {0.3 * std::cos(sway) - 0.3, 0, step * index}));
}

}  // namespace

std::vector<Rigid3d> corridor_poses(int keyframes, double step) {
  std::vector<Rigid3d> poses;
  for (int i = 0; i < keyframes; ++i) poses.push_back(keyframe_pose(i, step));
  return poses;
}

FactorGraph corridor_graph(int keyframes, int landmarks_per_step, double step) {
  Random random(1);
  const Camera camera = synthetic_stereo_camera(0.5);
  FactorGraph graph;
  graph.cameras.push_back({camera, 0});
  for (const Rigid3d& pose : corridor_poses(keyframes, step)) {
    graph.frames.push_back({pose, 0, graph.frames.empty()});
  }
  for (int i = 0; i < keyframes; ++i) {
    for (int k = 0; k < landmarks_per_step; ++k) {
      // On the walls, ahead of the keyframe of this number.
      const double side = random.uniform() < 0.5 ? -1 : 1;
      const double ahead = step * i + kNearest;
      graph.points.push_back(
          {{1.5 * side, random.uniform(-1, 1), ahead + step * random.uniform()}, false});
    }
  }
  for (std::uint32_t i = 0; i < graph.frames.size(); ++i) {
    const Rigid3d& cam_from_world = graph.frames[i].cam_from_world;
    const auto first = static_cast<std::uint32_t>(landmarks_per_step) * i;
    for (std::uint32_t p = first; p < graph.points.size(); ++p) {
      const Eigen::Vector3d in_cam = cam_from_world * graph.points[p].in_world;
      if (in_cam.z() > kFarthest) break;
      const auto seen = project_stereo(camera, in_cam);
      if (!seen || !in_image(camera, seen->head<2>())) continue;
      graph.observations.push_back({i, p, *seen + random.gaussian3(kSigma), kSigma});
    }
  }
  disturb(graph, 0.02, 0.002, 0.05, 9);
  return graph;
}

}  // namespace hybrid_slam
