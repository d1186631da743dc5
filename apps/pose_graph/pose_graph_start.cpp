#include "apps/pose_graph/pose_graph_start.h"

#include <limits>
#include <queue>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/SVD>

#include "apps/pose_graph/edge_laplacian.h"

namespace hybrid_slam {

namespace {

constexpr double kUnreached = std::numeric_limits<double>::infinity();

std::vector<Rigid3d> given_poses(const FactorGraph& graph) {
  std::vector<Rigid3d> poses;
  poses.reserve(graph.frames.size());
  for (const GraphFrame& frame : graph.frames) poses.push_back(frame.cam_from_world);
  return poses;
}

// The edges at each frame, by index, in the graph's order.
class EdgesAtFrame {
 public:
  explicit EdgesAtFrame(const FactorGraph& graph) : begin_(graph.frames.size() + 1, 0) {
    for (const GraphEdge& edge : graph.edges) {
      ++begin_[edge.a + 1];
      ++begin_[edge.b + 1];
    }
    for (std::size_t i = 1; i < begin_.size(); ++i) begin_[i] += begin_[i - 1];
    edges_.resize(begin_.back());
    std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
    for (std::size_t e = 0; e < graph.edges.size(); ++e) {
      edges_[next[graph.edges[e].a]++] = e;
      edges_[next[graph.edges[e].b]++] = e;
    }
  }

  template <typename Visit>
  void visit(std::size_t frame, const Visit& visit) const {
    for (std::size_t i = begin_[frame]; i < begin_[frame + 1]; ++i) visit(edges_[i]);
  }

 private:
  std::vector<std::size_t> begin_;  // into edges_, by frame
  std::vector<std::size_t> edges_;
};

// Paths from the known frames outwards, shortest first (Dijkstra).
class PathTree {
 public:
  PathTree(const FactorGraph& graph, const std::vector<char>& known)
      : graph_(graph),
        at_frame_(graph),
        distance_(graph.frames.size(), kUnreached),
        poses_(given_poses(graph)) {
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (!known[i]) continue;
      distance_[i] = 0;
      frontier_.emplace(0.0, i);
    }
    grow();
  }

  const std::vector<Rigid3d>& poses() const { return poses_; }

 private:
  void grow() {
    while (!frontier_.empty()) {
      const auto [distance, frame] = frontier_.top();
      frontier_.pop();
      if (distance > distance_[frame]) continue;
      at_frame_.visit(frame, [&, from = frame, so_far = distance](std::size_t e) {
        follow(graph_.edges[e], from, so_far);
      });
    }
  }

  void follow(const GraphEdge& edge, std::size_t from, double so_far) {
    const std::size_t to = edge.a == from ? edge.b : edge.a;
    const double distance = so_far + 1 / isotropic_weights(edge.information).rotation;
    if (distance >= distance_[to]) return;
    distance_[to] = distance;
    poses_[to] =
        edge.a == from ? inverse(edge.a_from_b) * poses_[from] : edge.a_from_b * poses_[from];
    frontier_.emplace(distance, to);
  }

  using Reached = std::pair<double, std::size_t>;  // distance, frame
  const FactorGraph& graph_;
  EdgesAtFrame at_frame_;
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> frontier_;
  std::vector<double> distance_;
  std::vector<Rigid3d> poses_;
};

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) = -u.col(2);
  return u * svd.matrixV().transpose();
}

// With C the rotation of cam_from_world, an edge says C_a = R_ab C_b. False if not solved.
bool relax_rotations(const FactorGraph& graph, const PoseGraphStructure& structure,
                     std::vector<Rigid3d>& poses) {
  std::vector<LinearEdge<3>> edges(graph.edges.size());
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const GraphEdge& edge = graph.edges[e];
    edges[e] = {isotropic_weights(edge.information).rotation,
                edge.a_from_b.rotation().toRotationMatrix(), Eigen::Matrix3d::Zero()};
  }
  std::vector<Eigen::Matrix3d> rotations(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    rotations[i] = poses[i].rotation().toRotationMatrix();
  }
  if (!solve_linear_edges<3>(structure.pattern, structure.couplings, edges, rotations))
    return false;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!structure.known[i])
      poses[i].rotation() = Eigen::Quaterniond(nearest_rotation(rotations[i]));
  }
  return true;
}

// With p the position of a frame in the world, an edge says p_a = p_b - C_a^T t_ab. Reads the
// rotations of `poses` and writes their translations.
bool solve_positions(const FactorGraph& graph, const PoseGraphStructure& structure,
                     std::vector<Rigid3d>& poses) {
  std::vector<LinearEdge<1>> edges(graph.edges.size());
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const GraphEdge& edge = graph.edges[e];
    const Eigen::Vector3d a_to_b =
        poses[edge.a].rotation().conjugate() * edge.a_from_b.translation();
    edges[e] = {isotropic_weights(edge.information).translation,
                Eigen::Matrix<double, 1, 1>::Ones(), -a_to_b.transpose()};
  }
  std::vector<Eigen::RowVector3d> positions(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    positions[i] = origin_in_a(graph.frames[i].cam_from_world).transpose();
  }
  if (!solve_linear_edges<1>(structure.pattern, structure.couplings, edges, positions))
    return false;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!structure.known[i])
      poses[i].translation() = -(poses[i].rotation() * positions[i].transpose());
  }
  return true;
}

}  // namespace

const char* name_of(PoseGraphStart start) {
  switch (start) {
    case PoseGraphStart::kGiven:
      return "given";
    case PoseGraphStart::kTree:
      return "tree";
    default:
      return "rotations";
  }
}

std::vector<PoseGraphStart> all_pose_graph_starts() {
  return {PoseGraphStart::kGiven, PoseGraphStart::kTree, PoseGraphStart::kRotations};
}

IsotropicWeights isotropic_weights(const Matrix6d& information) {
  const auto over_trace = [](double weight, const Eigen::Matrix3d& block) {
    const Eigen::LLT<Eigen::Matrix3d> llt(block);
    if (llt.info() != Eigen::Success) return 0.0;  // nothing is known in some direction
    return weight / llt.solve(Eigen::Matrix3d::Identity()).trace();
  };
  return {over_trace(1.5, information.bottomRightCorner<3, 3>()),
          over_trace(3, information.topLeftCorner<3, 3>())};
}

double isotropic_objective(const FactorGraph& graph) {
  double sum = 0;
  for (const GraphEdge& edge : graph.edges) {
    const IsotropicWeights weights = isotropic_weights(edge.information);
    const Rigid3d a = inverse(graph.frames[edge.a].cam_from_world);
    const Rigid3d b = inverse(graph.frames[edge.b].cam_from_world);
    const Rigid3d expected = a * edge.a_from_b;
    const Eigen::Matrix3d turn =
        b.rotation().toRotationMatrix() - expected.rotation().toRotationMatrix();
    sum += weights.rotation * turn.squaredNorm() +
           weights.translation * (b.translation() - expected.translation()).squaredNorm();
  }
  return sum;
}

std::vector<Rigid3d> start_poses(const FactorGraph& graph, const PoseGraphStructure& structure,
                                 PoseGraphStart start) {
  if (start == PoseGraphStart::kGiven) return given_poses(graph);
  const PathTree tree(graph, structure.known);
  if (start == PoseGraphStart::kTree) return tree.poses();
  std::vector<Rigid3d> poses = tree.poses();
  const bool solved =
      relax_rotations(graph, structure, poses) && solve_positions(graph, structure, poses);
  return solved ? poses : tree.poses();
}

std::vector<Rigid3d> start_poses(const FactorGraph& graph, PoseGraphStart start) {
  return start_poses(graph, PoseGraphStructure(graph), start);
}

}  // namespace hybrid_slam
