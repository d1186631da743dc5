#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "apps/io/stage_times.h"
#include "apps/pipeline/frame_source.h"
#include "apps/pipeline/loop_closing.h"
#include "apps/pipeline/slam_options.h"
#include "frontend/place_recognition/default_vocabulary.h"
#include "frontend/tracking/stereo_tracker.h"

namespace hybrid_slam {

struct RunOptions {
  int threads = 1;        // that read images and extract features; no result depends on it
  std::size_t limit = 0;  // frames to process at most; 0: all
  // Realtime: images per second, dropped when the pipeline is behind; 0: they wait for it.
  double rate = 0;
  int checkpoint_every = 0;  // keyframes: so often the map is saved on the way; 0: never
  Vocabulary vocabulary = default_vocabulary();  // that places are recognised with
  bool localize = false;                         // track in the given map without changing it

  // How many frames are processed of those that there are.
  std::size_t frames_of(std::size_t available) const {
    return limit > 0 ? std::min(limit, available) : available;
  }
};

enum class CameraKind { kStereo, kFisheye };

struct FrameCounts {
  int read = 0;  // handed to the pipeline, corrupt ones included
  int tracked = 0;
  int lost = 0;  // the map not yet begun included
  int dropped = 0;
  int corrupt = 0;
};

// What stays of a tracked frame.
struct FrameRecord {
  TrackedFrame frame;                  // without its keyframe and counts
  std::optional<KeyframeId> keyframe;  // the keyframe it became
  // Of a stereo frame: of the whole process, all its threads, from when this frame was taken up to
  // when the next one was [ms]. The first one's has the start of the run.
  double cpu_ms = 0;
};

struct RunProgress {
  std::size_t done = 0;
  std::size_t total = 0;
  FrameCounts frames;
  std::size_t keyframes = 0;
  std::size_t landmarks = 0;
};

// Something went wrong and the run goes on.
struct RunFailure {
  std::string text;       // one line
  bool internal = false;  // a bug of ours
};

// Saves a map and returns what went wrong, empty if nothing did.
using SaveMap = std::function<std::string(const MapSnapshot&)>;

// What a run needs from outside. When `cancelled` is requested, at any moment, the run ends in
// order, with what it has.
struct RunHooks {
  std::function<void(const RunProgress&)> progress;  // after each frame, in the calling thread
  std::function<void(const std::string&)> warning;   // one line each
  std::stop_token cancelled;
  // Saves the map so far. What goes wrong is a warning, what it throws an internal error as well;
  // the run goes on. Every-frame: in the calling thread; realtime: in another, one call at a time,
  // and maps that come meanwhile are left out but for the last.
  SaveMap checkpoint;
};

struct RunResult {
  FrameCounts frames;
  std::vector<FrameRecord> records;  // every stereo frame that was read, in order
  FrameCounts fisheye_frames;        // of those that came with a stereo frame that could be read
  std::vector<FrameRecord> fisheye_records;
  std::shared_ptr<const MapSnapshot> map;
  std::vector<LoopRecord> loops;  // places proposed, in the order in which they were looked at
  StageTimes times;
  bool cancelled = false;
  std::vector<std::string> internal_errors;  // that did not end the run; each was a warning, too

  // Final pose of a tracked frame, through its reference keyframe.
  Rigid3d cam_from_world(const FrameRecord& record) const;
};

// Every frame is tracked and mapped before the next one, loops closed and everything adjusted
// before that. Same input, options and seed give the same result, bit for bit. Goes on with `map`,
// if that is not empty.
RunResult run_every_frame(const FrameSource& source, const SlamOptions& options,
                          const RunOptions& run, const RunHooks& hooks, Map map = {});

// Reading, tracking, local mapping, the search for loops and full bundle adjustment in their own
// threads, joined at the end.
RunResult run_realtime(const FrameSource& source, const SlamOptions& options, const RunOptions& run,
                       const RunHooks& hooks, Map map = {});

}  // namespace hybrid_slam
