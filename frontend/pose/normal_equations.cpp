#include "frontend/pose/normal_equations.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace hybrid_slam {

template <int N>
std::optional<typename NormalEquations<N>::Step> NormalEquations<N>::solve(double damping) const {
  Matrix damped = full_information();
  damped.diagonal() *= 1 + damping;
  const Step step = -damped.ldlt().solve(gradient);
  if (!step.allFinite()) return std::nullopt;
  return step;
}

bool is_determined(const Eigen::Ref<const Eigen::MatrixXd>& information) {
  constexpr double kMinConditioning = 1e-12;  // smallest / largest eigenvalue of the scaled system
  if (!(information.diagonal().minCoeff() > 0) || !information.allFinite()) return false;
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled, Eigen::EigenvaluesOnly);
  const Eigen::VectorXd& values = eigen.eigenvalues();  // ascending
  return values[0] > kMinConditioning * values[values.size() - 1];
}

template struct NormalEquations<1>;
template struct NormalEquations<2>;
template struct NormalEquations<3>;
template struct NormalEquations<6>;
template struct NormalEquations<7>;

}  // namespace hybrid_slam
