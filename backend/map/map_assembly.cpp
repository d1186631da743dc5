#include "backend/map/map_assembly.h"

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "backend/map/components.h"
#include "backend/map/covisibility.h"
#include "backend/map/landmark_attributes.h"
#include "backend/map/map_file_format.h"
#include "backend/map/odometry.h"

namespace hybrid_slam {
namespace {

// Fills the tables part by part.
class MapAssembly {
 public:
  void add(const MapPart& part) {
    new_ids_.clear();
    add_cameras(*part.map);
    for (const KeyframeId id : part.keyframes) add_keyframe(part.map->at(id));
    for (const KeyframeId id : part.keyframes) add_odometry(*part.map, part.map->at(id));
    const auto stereo = std::find_if(part.keyframes.begin(), part.keyframes.end(),
                                     [&](KeyframeId id) { return is_stereo(new_id(id)); });
    if (stereo != part.keyframes.end()) first_stereo_.push_back(new_id(*stereo));
    for (const LandmarkId id : part.map->landmark_ids()) {
      const Landmark& landmark = part.map->at(id);
      if (!part.takes || part.takes(landmark)) add_landmark(landmark);
    }
    first_frame_ = 0;
    for (const std::int64_t newest : tables_.newest_frame_index) {
      first_frame_ = std::max(first_frame_, newest + 1);
    }
  }

  Map finish() {
    covisibility_.write(tables_.keyframes);
    if (tables_.next_keyframe > 0) tables_.origin = KeyframeId(0);
    make_tree();
    for (const KeyframeId id : first_stereo_) tie(id);
    name_components(tables_);
    tie_components();
    return MapFileAccess::make(std::move(tables_));
  }

 private:
  void add_cameras(const MapSnapshot& map) {
    cameras_.clear();
    for (std::uint32_t i = 0; i < map.camera_count(); ++i) {
      const Camera& camera = map.camera(CameraId(i));
      auto& known = tables_.cameras;
      const auto at = std::find(known.begin(), known.end(), camera) - known.begin();
      if (at == static_cast<std::ptrdiff_t>(known.size())) {
        known.push_back(camera);
        tables_.newest_frame_index.push_back(-1);
      }
      cameras_.emplace_back(static_cast<std::uint32_t>(at));
      const std::int64_t newest = map.newest_frame_index(CameraId(i));
      std::int64_t& stored = tables_.newest_frame_index[cameras_.back().value];
      if (newest >= 0) stored = std::max(stored, first_frame_ + newest);
      add_correction(map, CameraId(i));
    }
  }

  // Rigs change from dive to dive: the last one's holds.
  void add_correction(const MapSnapshot& map, CameraId from) {
    const RigCorrection correction = map.correction(from);
    const Keyframe* const newest = map.newest_keyframe(from);
    if (correction.empty() || newest == nullptr) return;
    const double time = newest->observations->time;
    const auto [known, first] = corrected_at_.try_emplace(cameras_.back(), time);
    if (!first && time < known->second) return;
    known->second = time;
    tables_.corrections[cameras_.back()] = correction;
  }

  std::shared_ptr<const FrameObservations> renamed(
      const std::shared_ptr<const FrameObservations>& frame) const {
    const CameraId camera = cameras_[frame->camera.value];
    if (camera == frame->camera && first_frame_ == 0) return frame;
    auto copy = std::make_shared<FrameObservations>(*frame);
    copy->camera = camera;
    copy->frame_index += first_frame_;
    return copy;
  }

  void add_keyframe(const Keyframe& from) {
    const DescriptorKind kind = from.observations->features.kind;
    if (kind_.value_or(kind) != kind) {
      throw std::invalid_argument("assemble_map: descriptors of several kinds");
    }
    kind_ = kind;
    const KeyframeId id(tables_.next_keyframe++);
    Keyframe& keyframe = tables_.keyframes.insert(id.value, {});
    keyframe.id = id;
    keyframe.observations = renamed(from.observations);
    keyframe.cam_from_world = from.cam_from_world;
    keyframe.landmarks.resize(from.landmarks.size());
    keyframe.keep = from.keep || id.value == 0;
    new_ids_.emplace(from.id, id);
  }

  KeyframeId new_id(KeyframeId id) const {
    const auto found = new_ids_.find(id);
    return found == new_ids_.end() ? KeyframeId() : found->second;
  }

  // Over keyframes that stay behind: one motion after the other.
  void add_odometry(const MapSnapshot& map, const Keyframe& from) {
    if (from.odometry == nullptr) return;
    Odometry odometry = *from.odometry;
    while (!new_id(odometry.previous).valid()) {
      const Keyframe* const between = map.find(odometry.previous);
      if (between == nullptr || between->odometry == nullptr) return;
      odometry.motion = odometry.motion * between->odometry->motion;
      odometry.previous = between->odometry->previous;
    }
    odometry.previous = new_id(odometry.previous);
    tables_.keyframes.edit(new_id(from.id).value).odometry =
        std::make_shared<const Odometry>(std::move(odometry));
  }

  void add_landmark(const Landmark& from) {
    Landmark landmark = from;
    landmark.observations.clear();
    for (const Observation& o : from.observations) {
      const KeyframeId id = new_id(o.keyframe);
      if (id.valid()) landmark.observations.push_back({id, o.keypoint});
    }
    if (landmark.observations.empty() || !is_supported(tables_, landmark)) return;
    landmark.id = LandmarkId(tables_.next_landmark++);
    landmark.reference = new_id(from.reference);
    if (!landmark.reference.valid()) landmark.reference = landmark.observations.front().keyframe;
    if (landmark.observations.size() != from.observations.size()) {
      update_appearance(tables_, landmark);
      update_geometry(tables_, landmark);
    }
    std::vector<Observation> before;
    for (const Observation& o : landmark.observations) {
      covisibility_.add(o.keyframe, before, +1);
      before.push_back(o);
      tables_.keyframes.edit(o.keyframe.value).landmarks[o.keypoint] = landmark.id;
    }
    tables_.landmarks.insert(landmark.id.value, std::move(landmark));
  }

  // Each keyframe hangs on the earlier one with which it shares most landmarks, else on the one
  // that its odometry comes from, else on the one before.
  void make_tree() {
    for (std::uint32_t i = 1; i < tables_.next_keyframe; ++i) {
      Keyframe& keyframe = tables_.keyframes.edit(i);
      int most = 0;
      for (const Covisible& edge : keyframe.covisible) {
        if (edge.id < keyframe.id && edge.shared_landmarks > most) {
          most = edge.shared_landmarks;
          keyframe.parent = edge.id;
        }
      }
      if (most == 0) {
        keyframe.parent = keyframe.odometry ? keyframe.odometry->previous : KeyframeId(i - 1);
      }
      tables_.keyframes.edit(keyframe.parent.value).children.push_back(keyframe.id);
    }
  }

  bool is_stereo(KeyframeId id) const {
    const Keyframe& keyframe = *tables_.keyframes.find(id.value);
    return baseline(tables_.cameras[keyframe.observations->camera.value]) > 0;
  }

  // A keyframe without odometry gets one of which nothing is known: it holds what is not connected
  // in an adjustment of everything.
  void tie(KeyframeId id) {
    const Keyframe& keyframe = *tables_.keyframes.find(id.value);
    const KeyframeId before = keyframe_before(tables_, id);
    if (keyframe.odometry != nullptr || !before.valid()) return;
    const Rigid3d guess =
        keyframe.cam_from_world * inverse(tables_.keyframes.find(before.value)->cam_from_world);
    tables_.keyframes.edit(id.value).odometry =
        std::make_shared<const Odometry>(Odometry{before, unknown_motion(guess), {}, 0});
  }

  // By the first stereo keyframe of each.
  void tie_components() {
    std::set<KeyframeId> tied;
    for (std::uint32_t i = 0; i < tables_.next_keyframe; ++i) {
      const Keyframe& keyframe = *tables_.keyframes.find(i);
      if (is_stereo(keyframe.id) && tied.insert(keyframe.component).second) tie(keyframe.id);
      if (keyframe.component == keyframe.id) tables_.keyframes.edit(i).keep = true;
    }
  }

  MapTables tables_;
  CovisibilityChanges covisibility_;
  std::optional<DescriptorKind> kind_;
  std::vector<KeyframeId> first_stereo_;  // of each part
  std::int64_t first_frame_ = 0;
  std::map<CameraId, double> corrected_at_;  // time of the newest keyframe [s]
  // Of the part that is being added.
  std::vector<CameraId> cameras_;
  std::map<KeyframeId, KeyframeId> new_ids_;
};

}  // namespace

Map assemble_map(std::span<const MapPart> parts) {
  MapAssembly assembly;
  for (const MapPart& part : parts) assembly.add(part);
  return assembly.finish();
}

}  // namespace hybrid_slam
