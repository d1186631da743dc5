#include "apps/pipeline/local_mapping.h"

#include <utility>

#include "frontend/mapping/fusion.h"
#include "frontend/mapping/triangulation.h"

namespace hybrid_slam {

void append_counts(const MapEdit& counts, MapEdit& waiting) {
  waiting.visible.insert(waiting.visible.end(), counts.visible.begin(), counts.visible.end());
  waiting.found.insert(waiting.found.end(), counts.found.begin(), counts.found.end());
}

LocalMapping::LocalMapping(const SlamOptions& options)
    : options_(options), backend_(options.backend), probation_(options.culling) {}

KeyframeId LocalMapping::process(const MappingJob& job, StageTimes& times, std::stop_token stop,
                                 const std::function<void()>& publish) {
  StageClock clock(times);
  backend_.apply(job.counts);
  const KeyframeId id = backend_.add(job.keyframe);
  backend_.apply(probation_.cull(backend_.view(), id));
  clock.lap("insert_keyframe");
  backend_.apply(triangulate_with_neighbours(backend_.view(), id, options_.triangulation));
  clock.lap("triangulate");
  backend_.apply(fuse_with_neighbours(backend_.view(), id, options_.fusion));
  clock.lap("fuse");
  publish();
  backend_.optimize_local(id, std::move(stop));
  clock.lap("local_bundle");
  backend_.apply(cull_keyframes(backend_.view(), id, options_.culling));
  clock.lap("cull_keyframes");
  publish();
  return id;
}

}  // namespace hybrid_slam
