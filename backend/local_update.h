#pragma once

#include <memory>
#include <stop_token>
#include <utility>
#include <vector>

#include "backend/map/map.h"
#include "backend/problem/local_bundle.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

class MapSmoother;

// The map optimised around its newest keyframes, by steps: Backend::begin_local() makes it of a
// snapshot, run() works in any thread while the backend takes in keyframes, and
// Backend::end_local() takes it in. The backend must outlive run().
class LocalUpdate {
 public:
  // Looks at `stop` between iterations and keeps what it has when stopped.
  void run(const std::stop_token& stop = {});

  double seconds() const { return result_.summary.seconds; }

 private:
  friend class Backend;
  LocalUpdate(Map& map, std::vector<KeyframeId> newest)
      : map_(map.snapshot()), moved_(map.branch()), newest_(std::move(newest)) {}

  std::shared_ptr<const MapSnapshot> map_;
  Map moved_;  // branched there
  std::vector<KeyframeId> newest_;
  MapSmoother* smoother_ = nullptr;  // or null: bundle adjustment of the keyframes' surroundings
  LocalBundleOptions local_;
  BundleResult result_;
  std::shared_ptr<const KeyframeCovariances> covariances_;
};

}  // namespace hybrid_slam
