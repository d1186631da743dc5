#pragma once

#include <memory>
#include <stop_token>

#include "backend/map/map.h"
#include "backend/problem/full_bundle.h"
#include "backend/problem/local_bundle.h"

namespace hybrid_slam {

struct BackendOptions {
  LocalBundleOptions local;
  FullBundleOptions full;
};

// The synchronous facade of the backend: owns the map, applies what the frontend sends, optimises.
// Knows no threads; a pipeline gives it to one worker, and everyone else reads snapshots.
class Backend {
 public:
  // Throws std::invalid_argument if the options are not valid.
  explicit Backend(const BackendOptions& options);

  CameraId add_camera(const Camera& camera);
  KeyframeId add(const NewKeyframe& keyframe);
  void apply(const MapEdit& edit);
  void set_keep(KeyframeId id);  // exempt from culling

  // Local bundle adjustment around a keyframe; outlier observations are erased from the map.
  // Between iterations it looks at `stop` and keeps what it has when stopped.
  BundleSummary optimize_local(KeyframeId around, std::stop_token stop = {});

  // Bundle adjustment of everything but the origin.
  BundleSummary optimize_full(std::stop_token stop = {});

  std::shared_ptr<const MapSnapshot> snapshot();
  const MapSnapshot& view() const { return map_.view(); }
  const Map& map() const { return map_; }

 private:
  BundleSummary optimize(const ProblemConfig& config, const std::stop_token& stop);

  BackendOptions options_;
  Map map_;
};

}  // namespace hybrid_slam
