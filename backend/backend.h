#pragma once

#include <memory>
#include <optional>
#include <stop_token>

#include "backend/incremental/map_smoother.h"
#include "backend/map/map.h"
#include "backend/problem/full_bundle.h"
#include "backend/problem/local_bundle.h"

namespace hybrid_slam {

// What improves the map after each new keyframe.
enum class LocalMethod {
  kIncremental,  // incremental smoothing of the whole graph
  kBundle,       // bundle adjustment of the keyframe's surroundings
};

struct BackendOptions {
  LocalMethod local_method = LocalMethod::kIncremental;
  LocalBundleOptions local;
  MapSmootherOptions incremental;
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

  // Improves the map after the newest keyframe was added, by the method of the options; outlier
  // observations are erased from the map. Bundle adjustment looks at `stop` between iterations and
  // keeps what it has when stopped; an incremental update is short.
  BundleSummary optimize_local(KeyframeId newest, std::stop_token stop = {});

  // Bundle adjustment of everything but the origin.
  BundleSummary optimize_full(std::stop_token stop = {});

  std::shared_ptr<const MapSnapshot> snapshot();
  const MapSnapshot& view() const { return map_.view(); }
  const Map& map() const { return map_; }

 private:
  BundleSummary take_in(BundleResult result);

  BackendOptions options_;
  Map map_;
  std::optional<MapSmoother> smoother_;  // in step with the map; none if that was moved since
};

}  // namespace hybrid_slam
