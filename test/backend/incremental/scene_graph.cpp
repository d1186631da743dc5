#include "test/backend/incremental/scene_graph.h"

namespace hybrid_slam {

FactorGraph scene_graph(const SyntheticSceneOptions& options) {
  const SyntheticScene scene = make_synthetic_scene(options);
  FactorGraph graph;
  for (const Camera& camera : scene.cameras) graph.cameras.push_back({camera, 0});
  for (const Eigen::Vector3d& point : scene.points_in_world) graph.points.push_back({point, false});
  std::vector<int> seen(scene.points_in_world.size(), 0);
  for (const SyntheticFrame& frame : scene.frames) {
    for (const int landmark : frame.landmark) ++seen[static_cast<std::size_t>(landmark)];
  }
  for (std::uint32_t i = 0; i < scene.frames.size(); ++i) {
    const SyntheticFrame& frame = scene.frames[i];
    const FrameObservations& observed = *frame.observations;
    graph.frames.push_back({frame.cam_from_world, observed.camera.value, i == 0});
    for (std::size_t k = 0; k < frame.landmark.size(); ++k) {
      if (seen[static_cast<std::size_t>(frame.landmark[k])] < 2) continue;
      const Keypoint& keypoint = observed.features.keypoints[k];
      const double u_right = observed.u_right.empty() ? kNoRightMatch : observed.u_right[k];
      graph.observations.push_back({i,
                                    static_cast<std::uint32_t>(frame.landmark[k]),
                                    {keypoint.x, keypoint.y, u_right},
                                    keypoint.sigma});
    }
  }
  return graph;
}

}  // namespace hybrid_slam
