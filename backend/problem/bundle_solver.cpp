#include "backend/problem/bundle_solver.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <utility>

#include "backend/problem/bundle_equations.h"
#include "backend/problem/trust_region.h"
#include "cameras/geometry/se3.h"

namespace hybrid_slam {

namespace {

using Clock = std::chrono::steady_clock;

// The defaults of ceres::Solver::Options 2.1, but for the steps that may fail one after the other
// (problem_solver.cpp).
constexpr double kGradientTolerance = 1e-10;
constexpr double kParameterTolerance = 1e-8;
constexpr double kLeastRadius = 1e-32;
constexpr int kMostInvalidSteps = 12;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Adds the time until its end to a sum.
class Timed {
 public:
  explicit Timed(double& sum) : sum_(sum) {}
  Timed(const Timed&) = delete;
  Timed& operator=(const Timed&) = delete;
  ~Timed() { sum_ += seconds_since(start_); }

 private:
  double& sum_;
  Clock::time_point start_ = Clock::now();
};

template <typename... Values>
std::string text_of(const char* format, Values... values) {
  char text[200];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

BundleLosses losses_of(const ProblemOptions& options, const SolveRound& round) {
  return {{round.loss, options.chi2_mono},
          {round.loss, options.chi2_stereo},
          {options.loop_loss, options.chi2_loop}};
}

// One run: the estimate, the equations around it, and the trust region.
class BundleMinimizer {
 public:
  BundleMinimizer(FactorGraph& graph, const GraphFactors& factors, const ProblemOptions& options,
                  const SolveRound& round, const BundleStructure& structure)
      : graph_(graph),
        options_(options),
        round_(round),
        structure_(structure),
        equations_(graph, factors, structure, losses_of(options, round)),
        trust_(options.trust_region) {
    for (const GraphFrame& frame : graph.frames)
      now_.cam_from_world.push_back(frame.cam_from_world);
    for (const std::uint32_t point : structure.points) {
      now_.point_in_world.push_back(graph.points[point].in_world);
    }
    candidate_ = now_;
  }

  SolveOutcome run(Clock::time_point start, const std::stop_token& stop,
                   const std::function<void(const IterationReport&)>& progress) {
    start_ = start;
    outcome_.build_seconds = seconds_since(start);
    IterationReport report;
    bool accepted = linearize();
    if (accepted) equations_.set_scale();
    report.cost = cost_;
    while (!ended_) {
      outcome_.iterations = report.iteration;
      report.seconds = seconds_since(start);
      if (progress) progress(report);
      if (stop.stop_requested()) end(SolveEnd::kStopped, "stopped on request");
      if (!ended_) check_limits(report.iteration, accepted);
      if (ended_) break;
      ++report.iteration;
      accepted = step(report);
    }
    write_back();
    return std::move(outcome_);
  }

 private:
  void end(SolveEnd how, std::string text) {
    ended_ = true;
    outcome_.end = how;
    outcome_.text = std::move(text);
  }

  bool linearize() {
    const Timed timed(outcome_.jacobian_seconds);
    cost_ = equations_.linearize(now_);
    if (!std::isfinite(cost_)) {
      end(SolveEnd::kFailed, "Residual and Jacobian evaluation failed.");
    }
    return !ended_;
  }

  void check_limits(int iteration, bool accepted) {
    const double seconds = seconds_since(start_);
    if (options_.max_seconds > 0 && seconds >= options_.max_seconds) {
      return end(SolveEnd::kTimeLimit, text_of("Maximum solver time reached. Total solver time: "
                                               "%e >= %e.",
                                               seconds, options_.max_seconds));
    }
    if (iteration >= round_.iterations) {
      return end(
          SolveEnd::kIterationLimit,
          text_of("Maximum number of iterations reached. Number of iterations: %d.", iteration));
    }
    if (accepted) {
      const double gradient = gradient_norm();
      if (gradient <= kGradientTolerance) {
        return end(SolveEnd::kConverged,
                   text_of("Gradient tolerance reached. Gradient max norm: %e <= %e", gradient,
                           kGradientTolerance));
      }
    }
    if (trust_.radius() <= kLeastRadius) {
      end(SolveEnd::kConverged, text_of("Minimum trust region radius reached. Trust region radius: "
                                        "%e <= %e",
                                        trust_.radius(), kLeastRadius));
    }
  }

  // Tries one step; whether it was taken.
  bool step(IterationReport& report) {
    if (!solve()) {
      report.cost = cost_;
      report.step_norm = 0;
      if (++invalid_ >= kMostInvalidSteps) {
        end(SolveEnd::kFailed, text_of("Number of consecutive invalid steps more than "
                                       "Solver::Options::max_num_consecutive_invalid_steps: %d",
                                       kMostInvalidSteps));
      }
      trust_.reject();
      return false;
    }
    invalid_ = 0;
    move(step_.poses, step_.points, candidate_);
    const double candidate_cost = evaluate_candidate();
    report.step_norm = step_norm();
    report.cost = candidate_cost;
    check_tolerances(report.step_norm, candidate_cost);
    if (ended_) return false;
    const double quality = (cost_ - candidate_cost) / equations_.model_decrease();
    if (!(quality > TrustRegion::kLeastQuality)) {
      trust_.reject();
      return false;
    }
    std::swap(now_, candidate_);
    norm_ = norm();
    if (!linearize()) return false;
    report.cost = cost_;
    trust_.accept(quality);
    return true;
  }

  bool solve() {
    const Timed timed(outcome_.linear_solver_seconds);
    return equations_.solve(trust_.radius(), step_) && equations_.model_decrease() > 0;
  }

  double evaluate_candidate() {
    const Timed timed(outcome_.residual_seconds);
    return std::min(equations_.cost(candidate_), std::numeric_limits<double>::max());
  }

  // Steps that are as small as this or gain as little as this are not taken any more.
  void check_tolerances(double step, double candidate_cost) {
    if (step <= kParameterTolerance * (norm_ + kParameterTolerance)) {
      return end(SolveEnd::kConverged,
                 text_of("Parameter tolerance reached. Relative step_norm: %e <= %e.",
                         step / (norm_ + kParameterTolerance), kParameterTolerance));
    }
    const double change = std::abs(cost_ - candidate_cost);
    if (change <= round_.function_tolerance * cost_) {
      end(SolveEnd::kConverged, text_of("Function tolerance reached. |cost_change|/cost: %e <= %e",
                                        change / cost_, round_.function_tolerance));
    }
  }

  void move(const Eigen::VectorXd& poses, const Eigen::VectorXd& points, BundleEstimate& to) const {
    for (Eigen::Index row = 0; row < structure_.rows(); ++row) {
      const std::uint32_t frame = structure_.frames[static_cast<std::size_t>(row)];
      to.cam_from_world[frame] = se3_exp(poses.segment<6>(6 * row)) * now_.cam_from_world[frame];
    }
    for (std::uint32_t p = 0; p < structure_.varying_points; ++p) {
      to.point_in_world[p] = now_.point_in_world[p] + points.segment<3>(3 * Eigen::Index{p});
    }
  }

  // How far a step along the gradient goes in any coordinate.
  double gradient_norm() {
    move(-equations_.pose_gradient(), -equations_.point_gradient(), candidate_);
    double most = 0;
    for (const std::uint32_t frame : structure_.frames) {
      const Vector7d difference =
          now_.cam_from_world[frame].params - candidate_.cam_from_world[frame].params;
      most = std::max(most, difference.lpNorm<Eigen::Infinity>());
    }
    for (std::uint32_t p = 0; p < structure_.varying_points; ++p) {
      const Eigen::Vector3d difference = now_.point_in_world[p] - candidate_.point_in_world[p];
      most = std::max(most, difference.lpNorm<Eigen::Infinity>());
    }
    return most;
  }

  double step_norm() const {
    double sum = 0;
    for (const std::uint32_t frame : structure_.frames) {
      sum += (now_.cam_from_world[frame].params - candidate_.cam_from_world[frame].params)
                 .squaredNorm();
    }
    for (std::uint32_t p = 0; p < structure_.varying_points; ++p) {
      sum += (now_.point_in_world[p] - candidate_.point_in_world[p]).squaredNorm();
    }
    return std::sqrt(sum);
  }

  double norm() const {
    double sum = 0;
    for (const std::uint32_t frame : structure_.frames) {
      sum += now_.cam_from_world[frame].params.squaredNorm();
    }
    for (std::uint32_t p = 0; p < structure_.varying_points; ++p) {
      sum += now_.point_in_world[p].squaredNorm();
    }
    return std::sqrt(sum);
  }

  void write_back() {
    for (const std::uint32_t frame : structure_.frames) {
      graph_.frames[frame].cam_from_world = now_.cam_from_world[frame];
    }
    for (std::uint32_t p = 0; p < structure_.varying_points; ++p) {
      graph_.points[structure_.points[p]].in_world = now_.point_in_world[p];
    }
  }

  FactorGraph& graph_;
  const ProblemOptions& options_;
  const SolveRound& round_;
  const BundleStructure& structure_;
  BundleEquations equations_;
  TrustRegion trust_;
  BundleEstimate now_;
  BundleEstimate candidate_;
  BundleStep step_;
  double cost_ = 0;
  double norm_ =
      -1;  // of the estimate, known from the first step on: the first one is no short one
  int invalid_ = 0;
  bool ended_ = false;
  Clock::time_point start_;
  SolveOutcome outcome_;
};

}  // namespace

bool is_plain_bundle(const FactorGraph& graph) {
  return !graph.observations.empty() && graph.priors.empty() && graph.similarities.empty() &&
         graph.blocks.empty() && graph.factors.empty() &&
         std::all_of(graph.cameras.begin(), graph.cameras.end(),
                     [](const GraphCamera& camera) { return camera.refined == 0; });
}

SolveOutcome solve_bundle_round(FactorGraph& graph, const GraphFactors& factors,
                                const ProblemOptions& options, const SolveRound& round,
                                const std::stop_token& stop,
                                const std::function<void(const IterationReport&)>& progress) {
  const Clock::time_point start = Clock::now();
  const BundleStructure structure(graph, factors.active);
  if (structure.empty()) {
    SolveOutcome outcome;
    outcome.text = kNothingVaries;
    return outcome;
  }
  return BundleMinimizer(graph, factors, options, round, structure).run(start, stop, progress);
}

}  // namespace hybrid_slam
