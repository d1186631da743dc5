#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "backend/problem/loss.h"

namespace hybrid_slam {

struct IncrementalOptions {
  // Terms are linearised anew when their residuals differ from what their linearisations predict
  // by more, in squares and together, than this fraction of the cost (which bounds how far the cost
  // is from its optimum), or when one term's do by more than `worst_mismatch` of a typical residual
  // (root mean square over all rows).
  double relinearization = 1e-4;
  double worst_mismatch = 0.5;
  // Back-substitution stops where a pose moves by less (metres, radians).
  double wildfire = 1e-5;
  // The same of other variables, in their standard deviations; three times as much of one that all
  // terms share, such as a calibration, which moves a little with every update and so seldom
  // reaches them all. What is left out of the cost is half the square of this.
  double block_wildfire = 0.1;
  int max_steps = 3;  // Gauss-Newton steps per update
  // Multiplications that relinearising old terms may cost per update, on average; what was not
  // spent is saved up for later ones, up to `burst` times as much. The rest waits its turn.
  double budget = 5e6;
  double burst = 3;
  Loss loss = Loss::kNone;  // of observations, at the square root of the threshold
  double chi2_mono = 5.991;
  double chi2_stereo = 7.815;
  Loss loop_loss = Loss::kNone;  // of edges that are loops, at the square root of their threshold
  double chi2_loop = 16.812;
  // Poses that stay in the system; older ones are marginalised: they and the landmarks they see are
  // minimised out, what that says about the others stays as a linear prior, and they no longer
  // move. A landmark that is seen again afterwards starts anew. What is left of a pose is about 300
  // bytes, of a landmark nothing once remove_point() was called. 0: all poses stay.
  int window = 0;
  // Landmarks that none of so many newest poses sees are condensed: what they say about the poses
  // that saw them stays as it was linearised, as one term for many of them (CondensedTerm), until
  // one of them changes or these poses move against one another. Nothing is lost. 0: never.
  int condense_after = 30;

  std::string validate() const;
};

struct UpdateSummary {
  int steps = 0;
  int damped = 0;   // of the steps: those that would have raised the cost, and were shortened
  int refused = 0;  // of the steps: those that would have raised the cost however short
  bool stopped = false;
  std::size_t undetermined = 0;      // directions that no term determines, and that were held
  std::size_t poses = 0;             // factored anew, over all steps
  std::size_t relinearized = 0;      // terms
  std::size_t evaluated = 0;         // rows of terms, after all steps
  std::size_t pending = 0;           // terms that wait to be linearised anew
  std::vector<std::uint32_t> moved;  // poses whose estimate changed, ascending
  std::vector<std::uint32_t> moved_blocks;  // likewise
  std::vector<std::uint32_t> marginalized;  // poses that no longer move, from now on; ascending
  double multiplications = 0;               // of the factorisation
};

}  // namespace hybrid_slam
