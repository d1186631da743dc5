#include <ceres/cost_function.h>

#include "backend/incremental/incremental_solver.h"
#include "backend/map/prefetch.h"

// What an IncrementalSolver asks the memory for before it goes through many terms.

namespace hybrid_slam {

// Null if there is none.
const LandmarkTerm* IncrementalSolver::landmark_at(std::span<const std::uint32_t> terms,
                                                   std::size_t at) const {
  if (at >= terms.size()) return nullptr;
  const Term& term = terms_[terms[at]];
  return term.kind == TermKind::kLandmark ? landmarks_[term.index].get() : nullptr;
}

// In steps of a few terms, since each tells where the next one's memory is.
void IncrementalSolver::fetch_poses(std::span<const std::uint32_t> terms, std::size_t at) const {
  if (at + 3 * kPrefetchAhead < terms.size()) prefetch(&terms_[terms[at + 3 * kPrefetchAhead]]);
  if (const LandmarkTerm* next = landmark_at(terms, at + 2 * kPrefetchAhead)) {
    prefetch(&next->poses);
  }
  if (const LandmarkTerm* next = landmark_at(terms, at + kPrefetchAhead)) {
    prefetch_all(next->poses);
  }
}

void IncrementalSolver::fetch(std::span<const std::uint32_t> terms, std::size_t at) const {
  if (at + 3 * kPrefetchAhead < terms.size()) prefetch(&terms_[terms[at + 3 * kPrefetchAhead]]);
  prefetch(landmark_at(terms, at + 2 * kPrefetchAhead));
  if (const LandmarkTerm* next = landmark_at(terms, at + kPrefetchAhead)) {
    prefetch_all(next->views);
    prefetch_all(next->factors);
  }
  if (const LandmarkTerm* next = landmark_at(terms, at + 1)) {
    for (const FactorView& view : next->factors) view.fetch();
  }
}

// What has_changed() reads.
void IncrementalSolver::fetch_change(std::span<const std::uint32_t> terms, std::size_t at) const {
  if (at + 3 * kPrefetchAhead < terms.size()) prefetch(&terms_[terms[at + 3 * kPrefetchAhead]]);
  prefetch(landmark_at(terms, at + 2 * kPrefetchAhead));
  if (const LandmarkTerm* next = landmark_at(terms, at + kPrefetchAhead)) {
    prefetch(next->change.get());
    prefetch_all(next->poses);
  }
  const LandmarkTerm* const next = landmark_at(terms, at + kPrefetchAhead / 2);
  if (next == nullptr || !next->change) return;
  prefetch_all(next->change->reach);
  prefetch_all(next->change->evaluated_at);
}

// Of landmarks whose views are in the cache.
void IncrementalSolver::fetch_measurements(std::span<const std::uint32_t> terms,
                                           std::size_t at) const {
  if (const LandmarkTerm* next = landmark_at(terms, at + kPrefetchAhead / 2)) {
    for (const LandmarkView& view : next->views) prefetch(&observations_[view.observation]);
    for (const FactorView& view : next->factors) prefetch(&factors_[view.factor]);
  }
  if (const LandmarkTerm* next = landmark_at(terms, at + 1)) {
    for (const FactorView& view : next->factors) {
      const Factor& factor = factors_[view.factor];
      prefetch(factor.function.get());
      prefetch_all(factor.given.variables);
    }
  }
}

}  // namespace hybrid_slam
