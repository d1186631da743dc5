#include "apps/io/graphs/g2o_information.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace hybrid_slam {

namespace {

constexpr double kRounding = 1e-12;  // of the highest eigenvalue: below, an eigenvalue is zero

}  // namespace

Eigen::MatrixXd InformationCuts::cut(const Eigen::MatrixXd& information, int line) {
  ++seen_;
  if (Eigen::LLT<Eigen::MatrixXd>(information).info() == Eigen::Success) return information;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(information);
  const Eigen::VectorXd& values = solver.eigenvalues();  // ascending
  const double low = values[0];
  const double high = values.cwiseAbs().maxCoeff();
  if (low >= -kRounding * high) {
    ++singular_;
    return information;
  }
  if (cut_++ == 0 || low / high < worst_) {
    worst_ = low / high;
    worst_line_ = line;
    lowest_ = low;
    highest_ = values[values.size() - 1];
  }
  const Eigen::MatrixXd positive =
      solver.eigenvectors() * values.cwiseMax(0).asDiagonal() * solver.eigenvectors().transpose();
  return 0.5 * (positive + positive.transpose());
}

std::vector<std::string> InformationCuts::warnings(const std::string& source) const {
  if (cut_ + singular_ == 0) return {};
  std::string text = fmt::format("{}: ", source);
  if (cut_ > 0) {
    text += fmt::format(
        "{} of {} informations have eigenvalues below zero, which are cut (worst in line {}: "
        "{:.3g} "
        "beside {:.3g})",
        cut_, seen_, worst_line_, lowest_, highest_);
  }
  if (singular_ > 0) {
    text += fmt::format("{}{} of {} informations are singular: they measure some directions only",
                        cut_ > 0 ? "; " : "", singular_, seen_);
  }
  return {text};
}

}  // namespace hybrid_slam
