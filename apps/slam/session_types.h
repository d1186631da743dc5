#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "apps/slam/diagnosis.h"
#include "apps/slam/frame_stream.h"
#include "apps/slam/inputs.h"
#include "apps/slam/loop_closing.h"
#include "backend/map/map_file.h"
#include "backend/map/map_snapshot.h"
#include "cameras/geometry/uncertain_motion.h"
#include "frontend/place_recognition/default_vocabulary.h"
#include "frontend/tracking/tracked_frame.h"

namespace hybrid_slam {

struct RigFindings;

enum class SessionMode {
  // Every input is tracked and mapped before the next, loops closed and everything adjusted before
  // that. Same input, options and seed give the same results, bit for bit.
  kEveryFrame,
  // Tracking, local mapping, the search for loops and full bundle adjustment in their own threads.
  kRealtime,
};

// Saves a map, with what is to be known of it, and returns what went wrong in one line, empty if
// nothing did.
using SaveMap = std::function<std::string(const MapSnapshot&, const MapFileInfo&)>;

// How a session works; how the SLAM works is in SlamOptions.
struct SessionOptions {
  SessionMode mode = SessionMode::kRealtime;
  int threads = 1;  // that extract features; no result depends on it
  SiftDevice device = SiftDevice::kCpu;
  Vocabulary vocabulary = default_vocabulary();  // that places are recognised with
  bool localize = false;                         // track in the given map without changing it
  // Realtime: who pushes faster than frames can be tracked loses the oldest of those that wait.
  // Otherwise push() waits; in every-frame mode it always does.
  bool drop = true;
  // By so much an input may come later than one of a later time [ns]. 0: 50 ms in realtime, where
  // nobody waits longer than needed, and 0.5 s in every-frame mode.
  Nanoseconds reorder_window = 0;
  int checkpoint_every = 0;  // keyframes: so often `checkpoint` is called with the map; 0: never
  // In every-frame mode in the session's own thread, in realtime in another, one call at a time;
  // maps that come meanwhile are left out but for the last.
  SaveMap checkpoint;
  std::size_t history = 2000;  // frames whose poses can be asked for
};

// What a pose rests on.
enum class TrackingState {
  kStarting,     // there is no map yet, or a component of it begins
  kMap,          // landmarks of the map
  kOdometry,     // the motion since a frame that the map held
  kRelocalised,  // found again in the map, by its looks
  kLost,
};

const char* to_string(TrackingState state);

// What became of one frame.
struct FrameResult {
  CameraKind camera = CameraKind::kStereo;
  Nanoseconds time = 0;
  std::int64_t index = 0;  // of its moment in the map: frames of both cameras at one time share it
  TrackingState state = TrackingState::kStarting;
  TrackedFrame tracked;  // without its keyframe and counts.visible
  // Of a fisheye whose moment has a stereo pair, where both have poses: the fisheye's pose in the
  // left camera, with all that both are off by in common taken out.
  std::optional<UncertainMotion> left_from_fisheye;
  std::vector<FoundCause> causes;  // what may be wrong, whether it was tracked or not
  int features = 0;
  int stereo_matches = 0;  // of them; 0 for a fisheye
  // Median of the absolute differences of the matches' rows [px]; none without matches.
  std::optional<double> row_error;
  std::size_t keyframes = 0;  // in the map that it was tracked in
  std::size_t landmarks = 0;
  // Of the map, that it has a pose in; invalid without one, and of the frame that begins one.
  KeyframeId component;
  bool mapping_behind = false;  // it could have become no keyframe: too many wait
  // Of the stereo pair: what is known of its calibration up to here.
  std::shared_ptr<const RigFindings> rig{};

  bool has_pose() const { return tracked.tracked(); }
};

// A frame became a keyframe.
struct KeyframeResult {
  CameraKind camera = CameraKind::kStereo;
  std::int64_t index = 0;  // as in FrameResult
  KeyframeId id;
};

// Why there is another map.
enum class MapChange {
  kKeyframe,
  kLoop,
  kFullBundle,
  kEnd,  // the last one of a session: all is taken in, the youngest landmarks are judged
};

const char* to_string(MapChange change);

// The pose of a frame that was told before, as the map has it now.
struct CorrectedPose {
  CameraKind camera = CameraKind::kStereo;
  Nanoseconds time = 0;
  Rigid3d cam_from_world;
};

// Something went wrong and the session goes on.
struct SessionFailure {
  std::string text;       // one line
  bool internal = false;  // a bug of ours
};

// Whom to tell; what is empty is not told. In every-frame mode all are called in the session's own
// thread, which waits: nothing is left out. In realtime they are called in a thread of their own,
// one after the other, in the order of what happened; who takes so long that kBacklog events wait
// loses the next ones, which are counted. They must not push, and must not end the session; they
// may cancel() it.
struct SessionObservers {
  static constexpr std::size_t kBacklog = 1000;

  std::function<void(const FrameResult&)> frame;  // after it was tracked
  std::function<void(const KeyframeResult&)> keyframe;
  std::function<void(const LoopRecord&)> loop;  // proposed, and what came of it
  std::function<void(const std::shared_ptr<const MapSnapshot>&, MapChange)> map;
  std::function<void(TrackingState from, TrackingState to)> state;  // of the stereo pair
  // After a loop or the adjustment of everything: frames of SessionOptions::history that it moved.
  std::function<void(std::span<const CorrectedPose>)> corrected;
  std::function<void(const LeftOut&)> left_out;  // an input that will not be tracked
  std::function<void(const SessionFailure&)> failure;
};

}  // namespace hybrid_slam
