#include "backend/backend.h"

#include <stdexcept>

#include "backend/problem/solve_bundle.h"

namespace hybrid_slam {

namespace {

void require_valid(const ProblemOptions& options, const char* name) {
  if (const std::string wrong = options.validate(); !wrong.empty()) {
    throw std::invalid_argument(std::string("BackendOptions: ") + name + ": " + wrong);
  }
}

}  // namespace

Backend::Backend(const BackendOptions& options) : options_(options) {
  require_valid(options.local.problem, "local bundle");
  require_valid(options.full.problem, "full bundle");
}

CameraId Backend::add_camera(const Camera& camera) { return map_.add_camera(camera); }

KeyframeId Backend::add(const NewKeyframe& keyframe) { return map_.add_keyframe(keyframe); }

void Backend::apply(const MapEdit& edit) { map_.apply(edit); }

void Backend::set_keep(KeyframeId id) { map_.set_keep(id); }

BundleSummary Backend::optimize_local(KeyframeId around, std::stop_token stop) {
  return optimize(make_local_bundle(map_.view(), around, options_.local), stop);
}

BundleSummary Backend::optimize_full(std::stop_token stop) {
  return optimize(make_full_bundle(map_.view(), options_.full), stop);
}

BundleSummary Backend::optimize(const ProblemConfig& config, const std::stop_token& stop) {
  BundleResult result = solve_bundle(map_.view(), config, stop);
  for (const auto& [id, camera] : result.cameras) map_.set_camera(id, camera);
  map_.move(result.cam_from_world, result.point_in_world);
  MapEdit edit;
  edit.erased_observations = std::move(result.outliers);
  map_.apply(edit);
  return result.summary;
}

std::shared_ptr<const MapSnapshot> Backend::snapshot() { return map_.snapshot(); }

}  // namespace hybrid_slam
