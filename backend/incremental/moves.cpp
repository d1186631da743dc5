#include <ceres/cost_function.h>

#include <stdexcept>
#include <string>
#include <utility>

#include "backend/incremental/incremental_solver.h"

// How the estimate of an IncrementalSolver is moved by others.

namespace hybrid_slam {

// A jump is an increment like any other, however far: what poses have in common of it leaves every
// term between them as it was linearised, and what they do not is predicted by the derivatives, to
// first order. check() finds what the rest is.
void IncrementalSolver::move_poses(
    const std::vector<std::pair<std::uint32_t, Rigid3d>>& cam_from_world) {
  for (const auto& [index, to] : cam_from_world) {
    if (index >= poses_.size() || variables_[poses_[index].variable].fixed ||
        !to.params.allFinite()) {
      throw std::logic_error("IncrementalSolver::move_poses: pose " + std::to_string(index) +
                             " is not there, is fixed, or is moved to what is not finite");
    }
  }
  for (const auto& [index, to] : cam_from_world) {
    Pose& pose = poses_[index];
    const std::uint32_t variable = pose.variable;
    tree_.shift(variable, pose.tangent.increment(se3_log(inverse(pose_at(variable)) * to)));
    pose.folded = to;
    pose.folded_delta = tree_.delta(variable);
    jumped_.push_back(variable);
  }
}

// Terms that a jump took off their linearisation are linearised where they are now, at once and
// whatever that costs: solved as they were, they would lead back from where the jump has brought
// them. Returns how many.
std::size_t IncrementalSolver::settle_moves() {
  check({}, std::exchange(jumped_, {}));
  if (mismatch_ <= options_.relinearization * squared_norm_) return 0;
  for (const std::uint32_t id : pending_) {
    terms_[id].pending = false;
    mismatch_ -= terms_[id].mismatch;
    terms_[id].mismatch = 0;
    mark_dirty(id);
  }
  return std::exchange(pending_, {}).size();
}

}  // namespace hybrid_slam
