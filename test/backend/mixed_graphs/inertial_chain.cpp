#include "test/backend/mixed_graphs/inertial_chain.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cameras/geometry/se3.h"
#include "factors/pose_prior.h"
#include "test/backend/mixed_graphs/test_factors.h"
#include "test/support/random.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

namespace {

constexpr double kSampleTime = 0.1;  // [s]
constexpr double kRadius = 5;        // [m]

// At a moment: on the circle, looking along it, swaying.
Rigid3d true_pose(double angle) {
  const Eigen::Vector3d place(kRadius * std::cos(angle), 0.5 * std::sin(3 * angle),
                              kRadius * std::sin(angle));
  const Eigen::Quaterniond heading =
      Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY()) *
      Eigen::AngleAxisd(0.2 * std::sin(5 * angle), Eigen::Vector3d::UnitX());
  return inverse(Rigid3d(heading, place));
}

GraphEdge noisy_edge(const std::vector<Rigid3d>& truth, std::uint32_t a, std::uint32_t b,
                     double scale, Random& random) {
  constexpr double kSigma = 0.01;
  Vector6d noise;
  noise << random.gaussian3(scale * kSigma), random.gaussian3(scale * kSigma);
  GraphEdge edge;
  edge.a = a;
  edge.b = b;
  edge.a_from_b = truth[a] * inverse(truth[b]) * se3_exp(noise);
  edge.information = Matrix6d::Identity() / (kSigma * kSigma);
  return edge;
}

// The velocities and accelerations of the places as they are, so that factors fit but for noise.
std::vector<Eigen::VectorXd> blocks_of(const std::vector<Rigid3d>& truth) {
  std::vector<Eigen::VectorXd> blocks;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const std::size_t j = std::min(i, truth.size() - 2);
    Eigen::VectorXd block(9);
    block << (inverse(truth[j + 1]).translation() - inverse(truth[j]).translation()) / kSampleTime,
        0.02, -0.01, 0.03, 0.1, -0.05, 0.2;
    blocks.push_back(block);
  }
  return blocks;
}

// Lets velocities differ from the way that is gone, and biases walk.
void disturb_blocks(std::vector<Eigen::VectorXd>& blocks, Random& random) {
  const InertialError weighed;
  Vector6d walk = Vector6d::Zero();
  for (Eigen::VectorXd& block : blocks) {
    block.head<3>() += random.gaussian3(weighed.sigma_place / kSampleTime);
    block.tail<6>() += walk;
    for (double& value : walk) value += weighed.sigma_bias * random.gaussian();
  }
}

// Ahead of each pose, on either side; all that see one observe it.
void add_landmarks(const InertialChainOptions& options, InertialChain& chain) {
  constexpr double kNearest = 1;  // [m]
  constexpr double kFarthest = 5;
  constexpr double kSigma = 0.5;  // [px]
  Random random(options.seed + 2000);
  FactorGraph& graph = chain.graph;
  const Calibrated<RectifiedStereo> camera = synthetic_stereo_camera(0.2);
  graph.cameras.push_back({camera, 0});
  for (GraphFrame& frame : graph.frames) frame.camera = 0;
  for (std::uint32_t i = 0; i < graph.frames.size(); ++i) {
    for (int k = 0; k < options.landmarks; ++k) {
      const Eigen::Vector3d in_cam(random.uniform(-1, 1), random.uniform(-1, 1),
                                   random.uniform(2, kFarthest));
      const Eigen::Vector3d at = inverse(chain.truth[i]) * in_cam;
      const auto point = static_cast<std::uint32_t>(graph.points.size());
      graph.points.push_back({at + random.gaussian3(0.05), false});
      for (std::uint32_t j = 0; j < graph.frames.size(); ++j) {
        const Eigen::Vector3d seen_at = chain.truth[j] * at;
        if (seen_at.z() < kNearest || seen_at.z() > kFarthest) continue;
        const auto seen = project_stereo(camera, seen_at);
        if (!seen || !in_image(camera, seen->head<2>())) continue;
        graph.observations.push_back(
            {j, point, *seen + random.gaussian3(options.noise * kSigma), kSigma});
      }
    }
  }
}

}  // namespace

InertialChain inertial_chain(const InertialChainOptions& options) {
  Random random(options.seed);
  InertialChain chain;
  FactorGraph& graph = chain.graph;
  const auto count = static_cast<std::uint32_t>(options.poses);
  for (std::uint32_t i = 0; i < count; ++i) {
    chain.truth.push_back(true_pose(2 * std::numbers::pi * options.laps * i / count));
  }
  chain.true_blocks = blocks_of(chain.truth);
  Random random_truth(options.seed + 1000);
  if (options.consistent) disturb_blocks(chain.true_blocks, random_truth);
  const auto lap = static_cast<std::uint32_t>(count / options.laps);
  for (std::uint32_t i = 0; i < count; ++i) {
    Vector6d error;
    error << random.gaussian3(0.02), random.gaussian3(0.01);
    graph.frames.push_back({se3_exp(error) * chain.truth[i], GraphFrame::kNoCamera, false});
    GraphBlock block;
    block.values = chain.true_blocks[i];
    for (double& value : block.values) value += 0.02 * random.gaussian();
    block.rides_with = i;
    if (options.world_vectors) block.world_vectors = {0};
    graph.blocks.push_back(block);
    if (i == 0) continue;
    const Rigid3d& a = chain.truth[i - 1];
    const Rigid3d& b = chain.truth[i];
    InertialError error_of;
    error_of.dt = kSampleTime;
    const Eigen::VectorXd& x_a = chain.true_blocks[i - 1];
    const Eigen::Vector3d turn =
        kSampleTime * x_a.segment<3>(3) + random.gaussian3(options.noise * error_of.sigma_turn);
    error_of.b_from_a =
        (b * inverse(a)).rotation() *
        Eigen::Quaterniond(1, -turn.x() / 2, -turn.y() / 2, -turn.z() / 2).normalized();
    const Eigen::Vector3d change = chain.true_blocks[i].head<3>() - x_a.head<3>();
    error_of.acceleration = a.rotation() * Eigen::Vector3d(change / kSampleTime) + x_a.tail<3>() +
                            random.gaussian3(options.noise * error_of.sigma_velocity / kSampleTime);
    graph.factors.push_back(
        {inertial_factor(error_of),
         {pose_variable(i - 1), pose_variable(i), block_variable(i - 1), block_variable(i)}});
    if (options.odometry)
      graph.edges.push_back(noisy_edge(chain.truth, i - 1, i, options.noise, random));
    if (options.loops && i >= lap && i % 5 == 0) {
      graph.edges.push_back(noisy_edge(chain.truth, i - lap, i, options.noise, random));
    }
  }
  if (options.anchor) {
    constexpr double kPoseSigma = 1e-3;
    constexpr double kBlockSigma = 0.05;
    Vector6d pose_error = Vector6d::Zero();
    Eigen::VectorXd block = chain.true_blocks[0];
    if (options.consistent) {
      pose_error << random_truth.gaussian3(kPoseSigma), random_truth.gaussian3(kPoseSigma);
      for (double& value : block) value += kBlockSigma * random_truth.gaussian();
    }
    const Matrix6d information = Matrix6d::Identity() / (kPoseSigma * kPoseSigma);
    graph.factors.push_back(
        {std::make_shared<PosePrior>(se3_exp(pose_error) * chain.truth[0], information),
         {pose_variable(0)}});
    graph.factors.push_back({value_factor<9>(block, kBlockSigma), {block_variable(0)}});
  }
  if (options.landmarks > 0) add_landmarks(options, chain);
  for (int k = 0; k < options.ranges; ++k) {
    const Eigen::Vector3d place = 3 * random.direction();
    GraphBlock beacon;
    beacon.values = place + random.gaussian3(0.3);
    const auto index = static_cast<std::uint32_t>(graph.blocks.size());
    graph.blocks.push_back(beacon);
    graph.factors.push_back({value_factor<3>(beacon.values, 1.0), {block_variable(index)}});
    for (std::uint32_t i = static_cast<std::uint32_t>(k); i < count; i += 2) {
      const double range = (inverse(chain.truth[i]).translation() - place).norm();
      GraphFactor factor{range_factor(range + 0.05 * random.gaussian(), 0.05),
                         {pose_variable(i), block_variable(index)}};
      factor.loss = Loss::kNone;
      graph.factors.push_back(factor);
    }
  }
  return chain;
}

MixedFeed::MixedFeed(FactorGraph graph, const IncrementalOptions& options)
    : graph_(std::move(graph)),
      edges_of_(graph_.frames.size()),
      factors_of_(graph_.frames.size()),
      observations_of_(graph_.frames.size()),
      blocks_of_(graph_.frames.size()),
      block_in_solver_(graph_.blocks.size(), GraphBlock::kNone),
      point_in_solver_(graph_.points.size(), GraphBlock::kNone),
      solver_(options) {
  if (const std::string wrong = graph_.validate(); !wrong.empty()) throw std::logic_error(wrong);
  for (const GraphCamera& camera : graph_.cameras) solver_.add_camera(camera.camera);
  for (std::uint32_t i = 0; i < graph_.blocks.size(); ++i) {
    const std::uint32_t frame = graph_.blocks[i].rides_with;
    if (frame == GraphBlock::kNone) {
      block_in_solver_[i] = solver_.add_block(graph_.blocks[i]);
    } else {
      blocks_of_[frame].push_back(i);
    }
  }
  for (std::uint32_t i = 0; i < graph_.edges.size(); ++i) {
    edges_of_[std::max(graph_.edges[i].a, graph_.edges[i].b)].push_back(i);
  }
  for (std::uint32_t i = 0; i < graph_.observations.size(); ++i) {
    observations_of_[graph_.observations[i].frame].push_back(i);
  }
  for (std::uint32_t i = 0; i < graph_.factors.size(); ++i) {
    std::uint32_t last = 0;
    for (const GraphVariable& variable : graph_.factors[i].variables) {
      if (variable.kind == GraphVariable::Kind::kPose) last = std::max(last, variable.index);
      if (variable.kind != GraphVariable::Kind::kBlock) continue;
      const std::uint32_t frame = graph_.blocks[variable.index].rides_with;
      if (frame != GraphBlock::kNone) last = std::max(last, frame);
    }
    factors_of_[last].push_back(i);
  }
}

void MixedFeed::add_next() {
  GraphFrame frame = graph_.frames[next_];
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();  // of the world, from start to estimate
  if (!frame.fixed && next_ > 0) {
    const Rigid3d start = frame.cam_from_world;
    frame.cam_from_world =
        start * inverse(graph_.frames[next_ - 1].cam_from_world) * solver_.pose(next_ - 1);
    turn = frame.cam_from_world.rotation().conjugate() * start.rotation();
  }
  solver_.add_pose(frame);
  for (const std::uint32_t i : blocks_of_[next_]) {
    GraphBlock block = graph_.blocks[i];
    block.values.head<3>() = turn * Eigen::Vector3d(block.values.head<3>());
    block_in_solver_[i] = solver_.add_block(block);
  }
  for (const std::uint32_t i : edges_of_[next_]) solver_.add_edge(graph_.edges[i]);
  for (const std::uint32_t i : factors_of_[next_]) {
    GraphFactor factor = graph_.factors[i];
    for (GraphVariable& variable : factor.variables) {
      if (variable.kind == GraphVariable::Kind::kBlock) {
        variable.index = block_in_solver_[variable.index];
      }
      if (variable.kind != GraphVariable::Kind::kPoint) continue;
      variable.index = known_point(variable.index);
    }
    solver_.add_factor(factor);
  }
  for (const std::uint32_t i : observations_of_[next_]) {
    GraphObservation seen = graph_.observations[i];
    seen.point = known_point(seen.point);
    solver_.add_observation(seen);
  }
  ++next_;
}

// In the solver; a new one lies before the next frame as it does in the graph.
std::uint32_t MixedFeed::known_point(std::uint32_t index) {
  std::uint32_t& point = point_in_solver_[index];
  if (point == GraphBlock::kNone) {
    point = solver_.add_point(inverse(solver_.pose(next_)) * (graph_.frames[next_].cam_from_world *
                                                              graph_.points[index].in_world));
  }
  return point;
}

UpdateSummary MixedFeed::feed_next() {
  add_next();
  return solver_.update();
}

}  // namespace hybrid_slam
