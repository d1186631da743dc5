#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "backend/problem/graph_factor.h"
#include "cameras/camera.h"
#include "cameras/geometry/sim3d.h"
#include "factors/prior_block.h"

namespace hybrid_slam {

// A camera of a graph. Bit k of `refined` says that params[k] varies; 0: the camera is known.
struct GraphCamera {
  Camera camera;
  std::uint32_t refined = 0;
};

// A pose that is sought, or known where `fixed`: a camera's frame, or a vertex of a pose graph.
struct GraphFrame {
  static constexpr std::uint32_t kNoCamera = std::numeric_limits<std::uint32_t>::max();

  Rigid3d cam_from_world;
  std::uint32_t camera = kNoCamera;  // index into FactorGraph::cameras
  bool fixed = false;
};

struct GraphPoint {
  Eigen::Vector3d in_world = Eigen::Vector3d::Zero();
  bool fixed = false;
};

// A point seen in a frame: the term |project(cam_from_world * point) - measurement|^2 / sigma^2.
struct GraphObservation {
  std::uint32_t frame = 0;
  std::uint32_t point = 0;
  // (u, v) or (u_left, v, u_right) [px]; u_right is NaN where a stereo pair has no right match.
  Eigen::Vector3d measurement = Eigen::Vector3d::Zero();
  double sigma = 1;  // [px]
};

// A measured motion between two frames, see factors/relative_pose_factor.h. Of g2o's edge i j:
// a = i, b = j, and the measurement is a_from_b.
struct GraphEdge {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  Rigid3d a_from_b;
  Matrix6d information = Matrix6d::Identity();  // translation first, in frame b
  bool loop = false;                            // takes the edges' robust loss
};

// What marginalised poses left on others, see factors/linear_prior.h.
struct GraphPrior {
  std::vector<std::uint32_t> frames;
  std::vector<Rigid3d> bases;  // as frames
  Eigen::MatrixXd jacobian;    // rows x (6 frames + tangents of the blocks)
  Eigen::VectorXd residual;
  std::vector<std::uint32_t> blocks = {};
  std::vector<PriorBlock> block_bases = {};  // as blocks; carriers count among `frames`
};

// The same with scale, for maps whose scale may have drifted: factors/relative_similarity_factor.h.
struct GraphSimilarity {
  Sim3d cam_from_world;
  bool fixed = false;
};

struct GraphSimilarityEdge {
  std::uint32_t a = 0;  // index into FactorGraph::similarities
  std::uint32_t b = 0;
  Sim3d a_from_b;
  Matrix7d information = Matrix7d::Identity();
  bool loop = false;
};

// An optimisation problem with its numbers: what a map's part, a bundle adjustment file and a pose
// graph have in common. Plain values; indices into the vectors. The solver moves the estimate.
struct FactorGraph {
  std::vector<GraphCamera> cameras;
  std::vector<GraphFrame> frames;
  std::vector<GraphPoint> points;
  std::vector<GraphObservation> observations;
  std::vector<GraphEdge> edges;
  std::vector<GraphPrior> priors;
  std::vector<GraphSimilarity> similarities;
  std::vector<GraphSimilarityEdge> similarity_edges;
  std::vector<GraphBlock> blocks;
  std::vector<GraphFactor> factors;

  // Empty if every index is in range, every number finite and every sigma and information
  // positive, else the first thing that is wrong. The solver requires it.
  std::string validate() const;
};

}  // namespace hybrid_slam
