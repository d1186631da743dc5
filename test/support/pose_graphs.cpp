#include "test/support/pose_graphs.h"

#include <numbers>

#include "cameras/geometry/se3.h"

namespace hybrid_slam {

namespace {

TestPoseGraph graph_of(std::vector<Rigid3d> truth) {
  TestPoseGraph test;
  test.truth = std::move(truth);
  for (const Rigid3d& pose : test.truth) test.graph.frames.emplace_back().cam_from_world = pose;
  test.graph.frames.front().fixed = true;
  return test;
}

void add_edge(TestPoseGraph& test, int a, int b, const PoseNoise& noise, Random& random) {
  const bool exact = noise.translation == 0 && noise.rotation == 0;
  Vector6d error;
  error << random.gaussian3(noise.translation), random.gaussian3(noise.rotation);
  GraphEdge edge;
  edge.a = static_cast<std::uint32_t>(a);
  edge.b = static_cast<std::uint32_t>(b);
  edge.a_from_b = test.truth[edge.a] * inverse(test.truth[edge.b]) * se3_exp(error);
  const double translation = exact ? 0.01 : noise.translation;
  const double rotation = exact ? 0.01 : noise.rotation;
  edge.information.diagonal().head<3>().setConstant(1 / (translation * translation));
  edge.information.diagonal().tail<3>().setConstant(1 / (rotation * rotation));
  test.graph.edges.push_back(edge);
}

}  // namespace

TestPoseGraph grid_pose_graph(const std::array<int, 3>& size, const PoseNoise& noise,
                              Random& random) {
  std::vector<Rigid3d> truth;
  for (int z = 0; z < size[2]; ++z) {
    for (int y = 0; y < size[1]; ++y) {
      for (int x = 0; x < size[0]; ++x) {
        const Eigen::Quaterniond attitude = random.rigid(0, std::numbers::pi).rotation();
        truth.push_back(inverse(Rigid3d(attitude, {1.0 * x, 1.0 * y, 1.0 * z})));
      }
    }
  }
  TestPoseGraph test = graph_of(std::move(truth));
  const std::array<int, 3> stride = {1, size[0], size[0] * size[1]};
  for (int i = 0; i < static_cast<int>(test.truth.size()); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const bool has_next = i / stride[axis] % size[axis] + 1 < size[axis];
      if (has_next) add_edge(test, i, i + stride[axis], noise, random);
    }
  }
  return test;
}

TestPoseGraph ring_pose_graph(int count, const PoseNoise& noise, Random& random) {
  std::vector<Rigid3d> truth;
  const double step = 2 * std::numbers::pi / count;
  const double radius = 0.5 / std::sin(0.5 * step);
  for (int i = 0; i < count; ++i) {
    const double angle = step * i;
    const Eigen::Quaterniond heading(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
    const Eigen::Vector3d position = radius * Eigen::Vector3d(std::sin(angle), -std::cos(angle), 0);
    truth.push_back(inverse(Rigid3d(heading, position)));
  }
  TestPoseGraph test = graph_of(std::move(truth));
  for (int i = 0; i < count; ++i) add_edge(test, i, (i + 1) % count, noise, random);
  return test;
}

void scatter(FactorGraph& graph, Random& random) {
  for (GraphFrame& frame : graph.frames) {
    if (!frame.fixed) frame.cam_from_world = random.rigid(5, std::numbers::pi);
  }
}

}  // namespace hybrid_slam
