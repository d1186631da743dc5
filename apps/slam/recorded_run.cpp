#include "apps/slam/recorded_run.h"

#include <algorithm>
#include <map>
#include <utility>

#include "apps/slam/main_component.h"
#include "backend/map/components.h"

namespace hybrid_slam {
namespace {

SessionObservers observers_of(Recorder& recorder, const ReplayHooks& hooks) {
  SessionObservers observers;
  observers.map = hooks.map;
  observers.frame = [&](const FrameResult& frame) { recorder.tracked(frame); };
  observers.keyframe = [&recorder, &hooks](const KeyframeResult& keyframe) {
    recorder.became_keyframe(keyframe);
    if (hooks.keyframe) hooks.keyframe(keyframe);
  };
  observers.loop = [&recorder, &hooks](const LoopRecord& loop) {
    recorder.looped(loop);
    if (hooks.loop) hooks.loop(loop);
  };
  observers.left_out = [&](const LeftOut& input) { recorder.left_out(input); };
  observers.failure = [&](const SessionFailure& failure) { recorder.failed(failure); };
  return observers;
}

KeyframeId component_of(const RunResult& result, const FrameRecord& record) {
  const KeyframeId id = record.keyframe.value_or(record.frame.reference);
  return id.valid() ? result.map->component(id) : KeyframeId();
}

}  // namespace

void settle_components(RunResult& result) {
  result.components = component_sizes(*result.map).size();
  std::map<KeyframeId, int> frames;
  for (const FrameRecord& record : result.records) {
    if (record.frame.tracked()) ++frames[component_of(result, record)];
  }
  const auto most =
      std::max_element(frames.begin(), frames.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most == frames.end()) return;
  const auto settle = [&](std::vector<FrameRecord>& records, FrameCounts& counts) {
    for (FrameRecord& record : records) {
      record.in_main = record.frame.tracked() && component_of(result, record) == most->first;
      if (!record.frame.tracked() || record.in_main) continue;
      --counts.tracked;
      ++counts.other_components;
    }
  };
  settle(result.records, result.frames);
  settle(result.fisheye_records, result.fisheye_frames);
}

RunResult recorded_run(const CameraRig& cameras, const SlamOptions& options, SessionOptions session,
                       const ReplayHooks& hooks, Map map, std::size_t total,
                       const PushInputs& push) {
  RunResult result;
  Recorder recorder(result, hooks, total);
  Session slam(cameras, options, std::move(session), observers_of(recorder, hooks), std::move(map));
  {
    const std::stop_callback cancel(hooks.cancelled, [&] { slam.cancel(); });
    push(slam, recorder);
    slam.finish();
  }
  recorder.finish(slam.counts(), hooks.cancelled.stop_requested());
  result.map = slam.map();
  settle_components(result);
  result.times = slam.times();
  result.upsampling = slam.upsampling();
  result.upsampled = slam.upsamples();
  result.file_info = slam.file_info();
  return result;
}

}  // namespace hybrid_slam
