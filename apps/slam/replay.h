#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "apps/slam/session.h"
#include "frontend/input/image_sequence.h"

namespace hybrid_slam {

struct RigFindings;

// Inputs of one moment, all of one time, or why there are none.
struct Moment {
  std::vector<SensorInput> inputs;
  std::string error;          // the stereo pair cannot be read; empty: it can
  std::string fisheye_error;  // likewise, the fisheye's image
};

// What is replayed: images of a dataset, or a simulation of features.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual std::size_t size() const = 0;
  virtual Nanoseconds time(std::size_t index) const = 0;
  virtual CameraRig cameras() const = 0;
  virtual Moment read(std::size_t index) const = 0;
};

// Images of a sequence, which must outlive it.
class ImageFrameSource final : public FrameSource {
 public:
  explicit ImageFrameSource(const ImageSequence& sequence) : sequence_(sequence) {}

  std::size_t size() const override { return sequence_.size(); }
  Nanoseconds time(std::size_t index) const override {
    return to_nanoseconds(sequence_.info().times[index]);
  }
  CameraRig cameras() const override { return {sequence_.info().stereo, sequence_.info().fisheye}; }
  Moment read(std::size_t index) const override;

 private:
  const ImageSequence& sequence_;
};

struct ReplayOptions {
  // Its checkpoint is called as said there; what it throws is an internal error as well.
  SessionOptions session;
  std::size_t limit = 0;  // moments to process at most; 0: all
  // Realtime: moments per second, as a camera gives them; frames are dropped when the session is
  // behind. 0: they wait for it.
  double rate = 0;

  // How many moments are processed of those that there are.
  std::size_t moments_of(std::size_t available) const {
    return limit > 0 ? std::min(limit, available) : available;
  }
};

struct FrameCounts {
  int read = 0;              // handed to the session, corrupt ones included
  int tracked = 0;           // in the component that holds most of the frames at the end
  int other_components = 0;  // in others
  int coasted = 0;           // gone through without a look at the world
  int lost = 0;              // the map not yet begun included
  int dropped = 0;
  int corrupt = 0;
};

// What of a TrackedFrame is needed after the run; it stays small, as a run may last for days.
struct RecordedFrame {
  std::int64_t frame_index = 0;
  double time = 0;  // [s]
  Rigid3d cam_from_reference;
  KeyframeId reference;
  PoseSource source = PoseSource::kNone;
  Prediction prediction = Prediction::kNone;

  bool tracked() const { return source != PoseSource::kNone && source != PoseSource::kCoasted; }
};

// What stays of a tracked frame.
struct FrameRecord {
  RecordedFrame frame;
  std::optional<KeyframeId> keyframe;  // the keyframe it became
  bool in_main = true;  // it has a pose in the component that holds most of the frames at the end
};

// What a stereo frame took.
struct FrameTimes {
  double time = 0;  // of the frame [s]
  // Of the whole process, all its threads, from when the stereo frame before was tracked [ms]. The
  // first one's has the start of the run, the last one's the end.
  double cpu_ms = 0;
  // Where somebody's clock gives the images (realtime at a rate, cameras): how long after they were
  // due it was tracked [ms]. None otherwise.
  std::optional<double> behind_ms{};
};

struct ReplayProgress {
  std::size_t done = 0;
  std::size_t total = 0;
  FrameCounts frames;
  std::size_t keyframes = 0;
  std::size_t landmarks = 0;
};

// What a run needs from outside; what is empty costs nothing. When `cancelled` is requested, at any
// moment, the run ends in order, with what it has. The functions are called by one thread at a
// time, not always the same.
struct ReplayHooks {
  std::function<void(const FrameResult&)> frame;  // of each camera, once it was tracked
  std::function<void(const LeftOut&)> left_out;   // of each camera, if it never will be
  // Of each stereo frame, when the next one was tracked, or none comes any more.
  std::function<void(const FrameTimes&)> times;
  // As SessionObservers tell of them.
  std::function<void(const KeyframeResult&)> keyframe;
  std::function<void(const LoopRecord&)> loop;
  std::function<void(const std::shared_ptr<const MapSnapshot>&, MapChange)> map;
  // What is about to be pushed. Called by who reads, while others are called.
  std::function<void(const Moment&)> images;
  std::function<void(const ReplayProgress&)> progress;  // after each stereo frame
  std::function<void(const std::string&)> warning;      // one line each
  std::stop_token cancelled;
};

// How often what was seen, by its name.
using NameCounts = std::map<std::string, int>;

// What frames of one camera were like.
struct FrameConditions {
  NameCounts states;
  NameCounts causes;
};

struct RunResult {
  FrameCounts frames;
  std::vector<FrameRecord> records;  // every stereo frame that was tracked or lost, in order
  FrameCounts fisheye_frames;        // of those that came with a stereo frame that could be read
  std::vector<FrameRecord> fisheye_records;
  FrameConditions conditions;
  FrameConditions fisheye_conditions;
  double disparity_offset = 0;  // of the newest stereo frame, see TrackedFrame
  double shading = 0;           // likewise
  std::shared_ptr<const MapSnapshot> map;
  std::size_t components = 0;     // of the map
  std::vector<LoopRecord> loops;  // places proposed, in the order in which they were looked at
  std::optional<UpsamplingEvidence> upsampling;  // none where there were no images
  bool upsampled = false;
  // The newest of the calibration, see FrameResult::rig; null where there is none.
  std::shared_ptr<const RigFindings> rig;
  MapFileInfo file_info;  // of the map, for save_map()
  StageTimes times;
  bool cancelled = false;
  std::vector<std::string> internal_errors;  // that did not end the run; each was a warning, too

  // Final pose of a tracked frame, through its reference keyframe.
  Rigid3d cam_from_world(const FrameRecord& record) const;
};

// Pushes a source through a session, from the first moment to the last. Goes on with `map`, if that
// is not empty.
RunResult replay(const FrameSource& source, const SlamOptions& options, ReplayOptions replay,
                 const ReplayHooks& hooks, Map map = {});

}  // namespace hybrid_slam
