#include "backend/problem/problem_builder.h"

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "backend/problem/joint_frame.h"
#include "backend/problem/observation_chi2.h"
#include "factors/left_jacobian.h"
#include "factors/linear_prior.h"
#include "factors/make_reprojection_factor.h"
#include "factors/manifolds.h"
#include "factors/relative_pose_factor.h"
#include "factors/relative_similarity_factor.h"

namespace hybrid_slam {

GraphFactors::GraphFactors() = default;
GraphFactors::GraphFactors(GraphFactors&&) noexcept = default;
GraphFactors& GraphFactors::operator=(GraphFactors&&) noexcept = default;
GraphFactors::~GraphFactors() = default;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

int param_count(const Camera& camera) {
  return std::visit([](const auto& c) { return static_cast<int>(c.params.size()); }, camera);
}

const double* params_of(const Camera& camera) {
  return std::visit([](const auto& c) { return c.params.data(); }, camera);
}

double squared_norm(const ceres::CostFunction& factor, const double* const* blocks) {
  double residual[7] = {};
  if (!factor.Evaluate(blocks, residual, nullptr)) return kInfinity;
  double sum = 0;
  for (int i = 0; i < factor.num_residuals(); ++i) sum += residual[i] * residual[i];
  return sum;
}

ceres::LossFunction* make_loss(Loss loss, double chi2_threshold) {
  switch (loss) {
    case Loss::kHuber:
      return new ceres::HuberLoss(std::sqrt(chi2_threshold));
    case Loss::kCauchy:
      return new ceres::CauchyLoss(std::sqrt(chi2_threshold));
    case Loss::kNone:
      break;
  }
  return nullptr;
}

// A loss that is made at its first use, since a problem frees only those that it was given.
class SharedLoss {
 public:
  SharedLoss(Loss loss, double chi2_threshold) : loss_(loss), threshold_(chi2_threshold) {}

  ceres::LossFunction* get() {
    if (made_ == nullptr) made_ = make_loss(loss_, threshold_);
    return made_;
  }

 private:
  Loss loss_;
  double threshold_;
  ceres::LossFunction* made_ = nullptr;
};

// A manifold that others have, too: a problem owns those that it is given.
class SharedManifold final : public ceres::Manifold {
 public:
  explicit SharedManifold(std::shared_ptr<const ceres::Manifold> shared)
      : shared_(std::move(shared)) {}

  int AmbientSize() const override { return shared_->AmbientSize(); }
  int TangentSize() const override { return shared_->TangentSize(); }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    return shared_->Plus(x, delta, x_plus_delta);
  }
  bool PlusJacobian(const double* x, double* jacobian) const override {
    return shared_->PlusJacobian(x, jacobian);
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    return shared_->Minus(y, x, y_minus_x);
  }
  bool MinusJacobian(const double* x, double* jacobian) const override {
    return shared_->MinusJacobian(x, jacobian);
  }

 private:
  std::shared_ptr<const ceres::Manifold> shared_;
};

class Builder {
 public:
  Builder(FactorGraph& graph, const GraphFactors& factors) : graph_(graph), factors_(factors) {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.manifold_ownership = ceres::TAKE_OWNERSHIP;
    options.disable_all_safety_checks = true;  // blocks are rows of vectors of their own
    made_.problem = std::make_unique<ceres::Problem>(options);
    problem_ = made_.problem.get();
    find_joint_frames();
  }

  CeresGraph build(const ProblemOptions& options, Loss observation_loss) {
    add_observations(SharedLoss(observation_loss, options.chi2_mono),
                     SharedLoss(observation_loss, options.chi2_stereo));
    add_edges(graph_.edges, factors_.edges, SharedLoss(options.loop_loss, options.chi2_loop),
              [this](std::uint32_t i) { return pose_block(i); });
    for (std::size_t i = 0; i < graph_.factors.size(); ++i) add_factor(i);
    for (std::size_t i = 0; i < graph_.priors.size(); ++i) {
      std::vector<double*> blocks;
      for (const std::uint32_t frame : graph_.priors[i].frames) {
        blocks.push_back(pose_block(frame));
      }
      for (const std::uint32_t block : graph_.priors[i].blocks) {
        blocks.push_back(other_block(block));
      }
      problem_->AddResidualBlock(factors_.priors[i].get(), nullptr, blocks);
    }
    add_edges(graph_.similarity_edges, factors_.similarity_edges,
              SharedLoss(options.loop_loss, options.chi2_loop),
              [this](std::uint32_t i) { return similarity_block(i); });
    return std::move(made_);
  }

 private:
  void add_observations(SharedLoss mono, SharedLoss stereo) {
    camera_blocks_.assign(graph_.cameras.size(), nullptr);
    for (std::size_t i = 0; i < graph_.observations.size(); ++i) {
      if (factors_.active[i] == 0) continue;
      const GraphObservation& observation = graph_.observations[i];
      const GraphFrame& frame = graph_.frames[observation.frame];
      double* point = graph_.points[observation.point].in_world.data();
      const bool refined = graph_.cameras[frame.camera].refined != 0;
      if (frame.fixed && graph_.points[observation.point].fixed && !refined) continue;
      SharedLoss& loss = residual_count(graph_, observation) == 3 ? stereo : mono;
      ceres::CostFunction* factor = make_observation(observation);
      if (!made_.joint_frames[observation.frame].empty()) {
        made_.joint_factors.push_back(std::make_unique<JointFrameFactor>(*factor));
        problem_->AddResidualBlock(made_.joint_factors.back().get(), loss.get(),
                                   joint_block(observation.frame), point);
        if (graph_.points[observation.point].fixed) problem_->SetParameterBlockConstant(point);
        continue;
      }
      double* pose = pose_block(observation.frame);
      if (refined) {
        problem_->AddResidualBlock(factor, loss.get(), pose, point, camera_block(frame.camera));
      } else {
        problem_->AddResidualBlock(factor, loss.get(), pose, point);
      }
      if (graph_.points[observation.point].fixed) problem_->SetParameterBlockConstant(point);
    }
  }

  ceres::CostFunction* make_observation(const GraphObservation& observation) {
    const GraphCamera& camera = graph_.cameras[graph_.frames[observation.frame].camera];
    made_.observations.push_back(
        camera.refined != 0
            ? make_refining_reprojection_factor(camera.camera, observation.measurement,
                                                observation.sigma)
            : make_reprojection_factor(camera.camera, observation.measurement, observation.sigma));
    return made_.observations.back().get();
  }

  template <typename Edge, typename BlockOf>
  void add_edges(const std::vector<Edge>& edges,
                 const std::vector<std::unique_ptr<ceres::CostFunction>>& factors,
                 SharedLoss loop_loss, const BlockOf& block_of) {
    for (std::size_t i = 0; i < edges.size(); ++i) {
      double* a = block_of(edges[i].a);
      double* b = block_of(edges[i].b);
      if (problem_->IsParameterBlockConstant(a) && problem_->IsParameterBlockConstant(b)) continue;
      problem_->AddResidualBlock(factors[i].get(), edges[i].loop ? loop_loss.get() : nullptr, a, b);
    }
  }

  void add_factor(std::size_t i) {
    if (factors_.factor_active[i] == 0) return;
    const GraphFactor& factor = graph_.factors[i];
    std::vector<double*> blocks;
    bool varies = false;
    for (const GraphVariable& variable : factor.variables) {
      double* block = block_of(variable);
      varies = varies || !problem_->IsParameterBlockConstant(block);
      blocks.push_back(block);
    }
    if (!varies) return;
    // Evaluated alone; the problem does not own it.
    auto* function = const_cast<ceres::CostFunction*>(factors_.factors[i].get());
    problem_->AddResidualBlock(function, make_loss(factor.loss, factor.threshold), blocks);
  }

  double* block_of(const GraphVariable& variable) {
    if (variable.kind == GraphVariable::Kind::kPose) return pose_block(variable.index);
    if (variable.kind == GraphVariable::Kind::kBlock) return other_block(variable.index);
    GraphPoint& point = graph_.points[variable.index];
    double* block = point.in_world.data();
    if (!problem_->HasParameterBlock(block)) problem_->AddParameterBlock(block, 3);
    if (point.fixed) problem_->SetParameterBlockConstant(block);
    return block;
  }

  double* other_block(std::uint32_t index) {
    GraphBlock& block = graph_.blocks[index];
    double* values = block.values.data();
    if (problem_->HasParameterBlock(values)) return values;
    problem_->AddParameterBlock(values, static_cast<int>(block.values.size()));
    if (block.manifold != nullptr) {
      problem_->SetManifold(values, new SharedManifold(block.manifold));
    }
    if (block.fixed) problem_->SetParameterBlockConstant(values);
    return values;
  }

  // Those with a refined camera that no other frame has, unless edges, factors or priors need the
  // pose as a block of its own.
  void find_joint_frames() {
    made_.joint_frames.resize(graph_.frames.size());
    if (!graph_.edges.empty() || !graph_.priors.empty() || !graph_.factors.empty()) return;
    std::vector<int> frames_of(graph_.cameras.size(), 0);
    for (const GraphFrame& frame : graph_.frames) {
      if (frame.camera != GraphFrame::kNoCamera) ++frames_of[frame.camera];
    }
    for (std::size_t i = 0; i < graph_.frames.size(); ++i) {
      const GraphFrame& frame = graph_.frames[i];
      if (frame.camera == GraphFrame::kNoCamera || frames_of[frame.camera] != 1) continue;
      const GraphCamera& camera = graph_.cameras[frame.camera];
      if (camera.refined == 0) continue;
      std::vector<double>& block = made_.joint_frames[i];
      const Vector7d& pose = frame.cam_from_world.params;
      block.assign(pose.data(), pose.data() + 7);
      const double* params = params_of(camera.camera);
      block.insert(block.end(), params, params + param_count(camera.camera));
    }
  }

  double* joint_block(std::uint32_t index) {
    const GraphFrame& frame = graph_.frames[index];
    double* block = made_.joint_frames[index].data();
    if (pose_added_.empty()) pose_added_.assign(graph_.frames.size(), 0);
    if (pose_added_[index] == 0) {
      pose_added_[index] = 1;
      const GraphCamera& camera = graph_.cameras[frame.camera];
      const int count = param_count(camera.camera);
      problem_->AddParameterBlock(block, 7 + count,
                                  new JointFrameManifold(count, camera.refined, frame.fixed));
    }
    return block;
  }

  double* pose_block(std::uint32_t index) {
    GraphFrame& frame = graph_.frames[index];
    double* block = frame.cam_from_world.params.data();
    if (pose_added_.empty()) pose_added_.assign(graph_.frames.size(), 0);
    if (pose_added_[index] == 0) {
      pose_added_[index] = 1;
      problem_->AddParameterBlock(block, 7, new PoseManifold);
      if (frame.fixed) problem_->SetParameterBlockConstant(block);
    }
    return block;
  }

  double* similarity_block(std::uint32_t index) {
    GraphSimilarity& similarity = graph_.similarities[index];
    double* block = similarity.cam_from_world.params.data();
    if (!problem_->HasParameterBlock(block)) {
      problem_->AddParameterBlock(block, 8, new Sim3Manifold);
      if (similarity.fixed) problem_->SetParameterBlockConstant(block);
    }
    return block;
  }

  double* camera_block(std::uint32_t index) {
    double*& block = camera_blocks_[index];
    if (block != nullptr) return block;
    GraphCamera& camera = graph_.cameras[index];
    block = hybrid_slam::params_of(camera.camera);
    const int count = param_count(camera.camera);
    std::vector<int> constant;
    for (int k = 0; k < count; ++k) {
      if ((camera.refined >> k & 1U) == 0) constant.push_back(k);
    }
    problem_->AddParameterBlock(block, count);
    if (!constant.empty()) {
      problem_->SetManifold(block, new ceres::SubsetManifold(count, constant));
    }
    return block;
  }

  FactorGraph& graph_;
  const GraphFactors& factors_;
  CeresGraph made_;
  ceres::Problem* problem_ = nullptr;
  std::vector<char> pose_added_;
  std::vector<double*> camera_blocks_;
};

}  // namespace

double* params_of(Camera& camera) {
  return std::visit([](auto& c) { return c.params.data(); }, camera);
}

GraphFactors make_factors(const FactorGraph& graph) {
  GraphFactors factors;
  factors.active.assign(graph.observations.size(), 1);
  factors.edges.reserve(graph.edges.size());
  for (const GraphEdge& edge : graph.edges) {
    factors.edges.push_back(std::make_unique<RelativePoseFactor>(edge.a_from_b, edge.information));
  }
  for (const GraphPrior& prior : graph.priors) {
    factors.priors.push_back(std::make_unique<LinearPrior>(prior.bases, prior.jacobian,
                                                           prior.residual, prior.block_bases));
  }
  factors.similarity_edges.reserve(graph.similarity_edges.size());
  for (const GraphSimilarityEdge& edge : graph.similarity_edges) {
    factors.similarity_edges.push_back(
        std::make_unique<RelativeSimilarityFactor>(edge.a_from_b, edge.information));
  }
  for (const GraphFactor& factor : graph.factors) {
    std::vector<char> is_pose;
    for (const GraphVariable& variable : factor.variables) {
      is_pose.push_back(variable.kind == GraphVariable::Kind::kPose ? 1 : 0);
    }
    factors.factors.push_back(left_jacobian(factor.function, is_pose));
  }
  factors.factor_active.assign(graph.factors.size(), 1);
  return factors;
}

std::vector<double> factors_chi2(const FactorGraph& graph, const GraphFactors& factors) {
  std::vector<double> values;
  for (std::size_t i = 0; i < graph.factors.size(); ++i) {
    std::vector<const double*> blocks;
    for (const GraphVariable& variable : graph.factors[i].variables) {
      switch (variable.kind) {
        case GraphVariable::Kind::kPose:
          blocks.push_back(graph.frames[variable.index].cam_from_world.params.data());
          break;
        case GraphVariable::Kind::kPoint:
          blocks.push_back(graph.points[variable.index].in_world.data());
          break;
        case GraphVariable::Kind::kBlock:
          blocks.push_back(graph.blocks[variable.index].values.data());
      }
    }
    Eigen::VectorXd residual(factors.factors[i]->num_residuals());
    const bool done = factors.factors[i]->Evaluate(blocks.data(), residual.data(), nullptr);
    values.push_back(done ? residual.squaredNorm() : kInfinity);
  }
  return values;
}

double edges_chi2(const FactorGraph& graph, const GraphFactors& factors) {
  double sum = 0;
  for (std::size_t i = 0; i < graph.edges.size(); ++i) {
    const double* blocks[] = {graph.frames[graph.edges[i].a].cam_from_world.params.data(),
                              graph.frames[graph.edges[i].b].cam_from_world.params.data()};
    sum += squared_norm(*factors.edges[i], blocks);
  }
  for (std::size_t i = 0; i < graph.priors.size(); ++i) {
    std::vector<const double*> blocks;
    for (const std::uint32_t frame : graph.priors[i].frames) {
      blocks.push_back(graph.frames[frame].cam_from_world.params.data());
    }
    for (const std::uint32_t block : graph.priors[i].blocks) {
      blocks.push_back(graph.blocks[block].values.data());
    }
    Eigen::VectorXd residual(graph.priors[i].residual.size());
    factors.priors[i]->Evaluate(blocks.data(), residual.data(), nullptr);
    sum += residual.squaredNorm();
  }
  for (std::size_t i = 0; i < graph.similarity_edges.size(); ++i) {
    const GraphSimilarityEdge& edge = graph.similarity_edges[i];
    const double* blocks[] = {graph.similarities[edge.a].cam_from_world.params.data(),
                              graph.similarities[edge.b].cam_from_world.params.data()};
    sum += squared_norm(*factors.similarity_edges[i], blocks);
  }
  return sum;
}

CeresGraph::CeresGraph() = default;
CeresGraph::CeresGraph(CeresGraph&&) noexcept = default;
CeresGraph::~CeresGraph() = default;

void CeresGraph::write_back(FactorGraph& graph) const {
  for (std::size_t i = 0; i < joint_frames.size(); ++i) {
    if (joint_frames[i].empty()) continue;
    GraphFrame& frame = graph.frames[i];
    std::copy_n(joint_frames[i].data(), 7, frame.cam_from_world.params.data());
    Camera& camera = graph.cameras[frame.camera].camera;
    std::copy_n(joint_frames[i].data() + 7, param_count(camera), params_of(camera));
  }
}

CeresGraph build_ceres_problem(FactorGraph& graph, const GraphFactors& factors,
                               const ProblemOptions& options, Loss observation_loss) {
  return Builder(graph, factors).build(options, observation_loss);
}

}  // namespace hybrid_slam
