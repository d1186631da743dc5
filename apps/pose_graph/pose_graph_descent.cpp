#include "apps/pose_graph/pose_graph_descent.h"

#include <cmath>

#include "cameras/geometry/se3.h"

namespace hybrid_slam {

namespace {

// What a step must promise per edge to be worth it, in squared whitened residuals: far below the 6
// that noise leaves, far above rounding errors.
constexpr double kNegligible = 1e-16;

struct LinearStep {
  Eigen::VectorXd step;
  bool accurate = false;  // within the tolerance
};

// Minimises the quadratic model by conjugate gradients from zero, preconditioned by the Cholesky
// factor of a similar matrix. (Golub, Van Loan, Matrix Computations, section 11.5.)
LinearStep solve_step(const BlockMatrix<6>& matrix, const Eigen::VectorXd& gradient,
                      const BlockCholesky& similar, const PoseGraphDescentOptions& options) {
  Eigen::VectorXd step = Eigen::VectorXd::Zero(gradient.size());
  Eigen::VectorXd residual = -gradient;
  Eigen::VectorXd scaled = similar.solve(residual);
  Eigen::VectorXd direction = scaled;
  double error = residual.dot(scaled);
  const double goal = options.step_tolerance * options.step_tolerance * error;
  for (int i = 0; i < options.step_iterations && error > goal; ++i) {
    const Eigen::VectorXd image = matrix * direction;
    const double length = error / direction.dot(image);
    step += length * direction;
    residual -= length * image;
    scaled = similar.solve(residual);
    const double new_error = residual.dot(scaled);
    direction = scaled + (new_error / error) * direction;
    error = new_error;
  }
  return {std::move(step), error <= goal};
}

}  // namespace

PoseGraphProblem::PoseGraphProblem(const FactorGraph& graph) : structure_(graph) {
  for (const GraphEdge& edge : graph.edges) factors_.emplace_back(edge.a_from_b, edge.information);
}

double PoseGraphProblem::cost(const std::vector<Rigid3d>& cam_from_world) const {
  double sum = 0;
  for (std::size_t e = 0; e < factors_.size(); ++e) {
    const auto& [a, b] = structure_.couplings[e];
    const double* blocks[] = {cam_from_world[a].params.data(), cam_from_world[b].params.data()};
    Vector6d residual;
    factors_[e].Evaluate(blocks, residual.data(), nullptr);
    sum += 0.5 * residual.squaredNorm();
  }
  return sum;
}

double PoseGraphProblem::linearize(const std::vector<Rigid3d>& cam_from_world,
                                   BlockMatrix<6>& matrix, Eigen::VectorXd& gradient) const {
  using Jacobian = Eigen::Matrix<double, 6, 7, Eigen::RowMajor>;
  matrix.set_zero();
  gradient.setZero(6 * structure_.pattern.rows());
  double sum = 0;
  for (std::size_t e = 0; e < factors_.size(); ++e) {
    const auto& [a, b] = structure_.couplings[e];
    const double* blocks[] = {cam_from_world[a].params.data(), cam_from_world[b].params.data()};
    Vector6d residual;
    Jacobian padded_a;
    Jacobian padded_b;
    double* jacobians[] = {padded_a.data(), padded_b.data()};
    factors_[e].Evaluate(blocks, residual.data(), jacobians);
    sum += 0.5 * residual.squaredNorm();
    const Matrix6d by_a = padded_a.leftCols<6>();
    const Matrix6d by_b = padded_b.leftCols<6>();
    const int row_a = structure_.pattern.row(a);
    const int row_b = structure_.pattern.row(b);
    if (row_a != BlockPattern::kNone) {
      matrix.add_to_diagonal(row_a, by_a.transpose() * by_a);
      gradient.segment<6>(6 * row_a) += by_a.transpose() * residual;
    }
    if (row_b != BlockPattern::kNone) {
      matrix.add_to_diagonal(row_b, by_b.transpose() * by_b);
      gradient.segment<6>(6 * row_b) += by_b.transpose() * residual;
    }
    const BlockPattern::Slot& slot = structure_.pattern.slot(e);
    if (slot.column != BlockPattern::kNone) matrix.add(slot, by_a.transpose() * by_b);
  }
  return sum;
}

std::vector<Rigid3d> PoseGraphProblem::moved(const std::vector<Rigid3d>& cam_from_world,
                                             const Eigen::VectorXd& step) const {
  std::vector<Rigid3d> poses = cam_from_world;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const int row = structure_.pattern.row(i);
    if (row != BlockPattern::kNone) poses[i] = se3_exp(step.segment<6>(6 * row)) * poses[i];
  }
  return poses;
}

PoseGraphDescent PoseGraphProblem::descend(std::vector<Rigid3d>& cam_from_world,
                                           const PoseGraphDescentOptions& options,
                                           const std::stop_token& stop,
                                           const std::function<void(int, double)>& progress) const {
  BlockMatrix<6> matrix(structure_.pattern);
  Eigen::VectorXd gradient;
  BlockCholesky cholesky;
  bool factor_anew = true;
  PoseGraphDescent result;
  result.initial_cost = result.cost = linearize(cam_from_world, matrix, gradient);
  for (;;) {
    if (progress) progress(result.iterations, result.cost);
    if (stop.stop_requested()) result.end = DescentEnd::kStopped;
    if (stop.stop_requested() || result.iterations >= options.iterations) return result;
    if (factor_anew) {
      ++result.factorizations;
      if (!cholesky.factorize(matrix.lower())) break;
    }
    const LinearStep linear = solve_step(matrix, gradient, cholesky, options);
    if (!linear.step.allFinite()) break;
    factor_anew = !linear.accurate;
    const double promised = -0.5 * gradient.dot(linear.step);
    const bool last = promised <= options.function_tolerance * result.cost +
                                      kNegligible * static_cast<double>(factors_.size());
    std::vector<Rigid3d> poses = moved(cam_from_world, linear.step);
    const double new_cost = last ? cost(poses) : linearize(poses, matrix, gradient);
    ++result.iterations;
    if (new_cost < result.cost) {
      result.cost = new_cost;
      cam_from_world = std::move(poses);
    } else if (!last) {
      break;
    }
    if (last) {
      if (progress) progress(result.iterations, result.cost);
      result.end = DescentEnd::kConverged;
      return result;
    }
  }
  result.end = DescentEnd::kUphill;
  return result;
}

}  // namespace hybrid_slam
