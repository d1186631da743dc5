#include "apps/pipeline/recorder.h"

namespace hybrid_slam {

Rigid3d RunResult::cam_from_world(const FrameRecord& record) const {
  if (record.keyframe) {
    return map->cam_from_world(*record.keyframe);
  }
  return record.frame.cam_from_reference * map->cam_from_world(record.frame.reference);
}

void Recorder::corrupt(const std::string& reason) {
  ++result_.frames.read;
  ++result_.frames.corrupt;
  warn(reason);
  report();
}

void Recorder::failed(const std::optional<RunFailure>& failure) {
  if (!failure) {
    return;
  }
  warn(failure->text);
  if (failure->internal) {
    result_.internal_errors.push_back(failure->text);
  }
}

void Recorder::warn(const std::string& text) {
  if (hooks_.warning) {
    hooks_.warning(text);
  }
}

void Recorder::tracked(const TrackedFrame& frame, const MapSnapshot& map) {
  ++result_.frames.read;
  ++(frame.tracked() ? result_.frames.tracked : result_.frames.lost);
  record_of_frame_[frame.frame_index] = result_.records.size();
  FrameRecord record{frame, std::nullopt};
  record.frame.keyframe.reset();
  record.frame.counts = {};
  result_.records.push_back(std::move(record));
  progress_.keyframes = map.keyframe_count();
  progress_.landmarks = map.landmark_count();
  report();
}

void Recorder::became_keyframe(std::int64_t frame_index, KeyframeId id) {
  result_.records[record_of_frame_.at(frame_index)].keyframe = id;
}

bool Recorder::cancelled() {
  result_.cancelled = result_.cancelled || (hooks_.cancelled != nullptr && *hooks_.cancelled);
  return result_.cancelled;
}

void Recorder::report() {
  if (!hooks_.progress) {
    return;
  }
  progress_.frames = result_.frames;
  progress_.done = static_cast<std::size_t>(result_.frames.read) +
                   static_cast<std::size_t>(result_.frames.dropped);
  hooks_.progress(progress_);
}

}  // namespace hybrid_slam
