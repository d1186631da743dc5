#include "backend/backend.h"

#include <stdexcept>

#include "backend/problem/solve_bundle.h"

namespace hybrid_slam {

namespace {

template <typename Options>
void require_valid(const Options& options, const char* name) {
  if (const std::string wrong = options.validate(); !wrong.empty()) {
    throw std::invalid_argument(std::string("BackendOptions: ") + name + ": " + wrong);
  }
}

}  // namespace

Backend::Backend(const BackendOptions& options) : options_(options) {
  require_valid(options.local.problem, "local bundle");
  require_valid(options.incremental, "incremental");
  require_valid(options.full.problem, "full bundle");
}

CameraId Backend::add_camera(const Camera& camera) { return map_.add_camera(camera); }

KeyframeId Backend::add(const NewKeyframe& keyframe) { return map_.add_keyframe(keyframe); }

void Backend::apply(const MapEdit& edit) { map_.apply(edit); }

void Backend::set_keep(KeyframeId id) { map_.set_keep(id); }

BundleSummary Backend::optimize_local(KeyframeId newest, std::stop_token stop) {
  if (options_.local_method == LocalMethod::kBundle) {
    return take_in(solve_bundle(view(), make_local_bundle(view(), newest, options_.local), stop));
  }
  if (!smoother_) smoother_.emplace(options_.incremental);
  return take_in(smoother_->update(snapshot(), newest));
}

BundleSummary Backend::optimize_full(std::stop_token stop) {
  smoother_.reset();
  return take_in(solve_bundle(view(), make_full_bundle(view(), options_.full), stop));
}

BundleSummary Backend::take_in(BundleResult result) {
  for (const auto& [id, camera] : result.cameras) map_.set_camera(id, camera);
  map_.move(result.cam_from_world, result.point_in_world);
  MapEdit edit;
  edit.erased_observations = std::move(result.outliers);
  map_.apply(edit);
  return result.summary;
}

std::shared_ptr<const MapSnapshot> Backend::snapshot() { return map_.snapshot(); }

}  // namespace hybrid_slam
