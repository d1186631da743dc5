#pragma once

#include <cmath>
#include <optional>

#include "frontend/pose/normal_equations.h"

namespace hybrid_slam {

// When to stop.
struct GaussNewtonStop {
  int iterations;    // steps tried, at most; those that are refused count
  double converged;  // length of a step, in the units of the unknowns
  // Half the digits of a double: such a step is rounding. With 0 nothing is damped, and the first
  // step that does not descend is the last one tried.
  double max_damping = 1e8;
};

template <typename State, int N>
struct GaussNewtonMinimum {
  State state;
  NormalEquations<N> equations;  // where the last step began, if converged; else at `state`
  bool converged = false;
};

// Minimises a dense least-squares problem of N unknowns: Gauss-Newton as long as its steps lower
// the cost, Levenberg and Marquardt's damping where one does not (Nocedal and Wright, Numerical
// Optimization, 2006, chapter 10.3; Marquardt's scaling by the diagonal).
//
//   linearize(state) -> std::optional<NormalEquations<N>>, none where the state has no cost
//   move(step, state) -> State
//
// Converged: the full Gauss-Newton step is shorter than stop.converged. It is taken without a look
// at its cost, for the one after it would be shorter still. A damped step is short because it is
// damped, so its length says nothing. Not converged: stop.iterations are used up, or no step
// lowers the cost with stop.max_damping. The state is then the best one seen.
// None if the start has no finite cost. Whether the problem determines its unknowns is another
// question: is_determined(minimum.equations.full_information()). Allocates nothing.
template <int N, typename State, typename Linearize, typename Move>
std::optional<GaussNewtonMinimum<State, N>> damped_gauss_newton(const State& start,
                                                                const Linearize& linearize,
                                                                const Move& move,
                                                                const GaussNewtonStop& stop) {
  constexpr double kFirstDamping = 1e-4;  // times ten where a step is refused, a tenth where not
  constexpr double kRounding = 1e-12;     // by which the last steps may change the cost
  const std::optional<NormalEquations<N>> at_start = linearize(start);
  if (!at_start || !std::isfinite(at_start->cost)) return std::nullopt;
  GaussNewtonMinimum<State, N> best{start, *at_start};
  double damping = 0;
  for (int i = 0; i < stop.iterations && damping <= stop.max_damping; ++i) {
    const auto step = best.equations.solve(damping);
    if (step && damping == 0 && step->norm() < stop.converged) {
      best.state = move(*step, best.state);
      best.converged = true;
      break;
    }
    if (step) {
      const State trial = move(*step, best.state);
      const std::optional<NormalEquations<N>> at_trial = linearize(trial);
      if (at_trial && at_trial->cost <= best.equations.cost * (1 + kRounding)) {
        best.state = trial;
        best.equations = *at_trial;
        damping = damping > kFirstDamping ? damping / 10 : 0;
        continue;
      }
    }
    damping = damping > 0 ? damping * 10 : kFirstDamping;
  }
  return best;
}

}  // namespace hybrid_slam
