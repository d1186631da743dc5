#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "apps/slam/session_types.h"
#include "apps/slam/slam_options.h"
#include "backend/map/map.h"

namespace hybrid_slam {

struct SessionCounts {
  StreamCounts stereo;
  StreamCounts fisheye;
  std::size_t waiting = 0;    // inputs that are not yet tracked
  std::int64_t overruns = 0;  // events that a slow observer did not hear of
};

// The SLAM as one object: images go in as the cameras give them, poses and the map come out.
//
//   Session session(cameras, options, {}, {.frame = [](const FrameResult& frame) { ... }});
//   session.push(StereoImages{time, left, right});
//   session.push(FisheyeImage{time, image});
//   ...
//   session.finish();
//   session.save("map.hslam");
//
// Functions may be called from any thread, but for finish(), reset() and the destructor: from one.
class Session {
 public:
  // Goes on with `map`, if that is not empty. Throws std::invalid_argument if the options are not
  // valid, std::logic_error to localise in an empty map.
  Session(const CameraRig& cameras, const SlamOptions& options, SessionOptions session = {},
          SessionObservers observers = {}, Map map = {});
  ~Session();  // as cancel(), unless it has finished

  // In any order within the reordering window. In realtime mode it takes the input over and
  // returns; see SessionOptions::drop. In every-frame mode it waits for room. Says what became of
  // the input; what is not taken is counted. Rethrows what ended the session.
  PushResult push(SensorInput input);

  // The same, and waits for the result: everything pushed before is tracked, too, so what comes
  // later must be of a later time. None if the input was not taken, or dropped.
  std::optional<FrameResult> track(SensorInput input);

  // Tracks what was pushed, closes loops that were found, adjusts everything. Nothing is taken
  // afterwards. Rethrows what ended the session.
  void finish();

  // Ends without what is still to be done, with what there is; finish() then returns at once.
  void cancel();

  // Forgets the map and begins another. What was pushed before and not yet tracked goes into it.
  void reset();

  // The newest map; never null. It does not change.
  std::shared_ptr<const MapSnapshot> map() const;

  // Pose of a camera at a time, as known now (cam_from_world): of a frame, or between two. None
  // before and after the frames that are kept (SessionOptions::history), and where it was lost.
  std::optional<Rigid3d> pose_at(CameraKind camera, Nanoseconds time) const;

  // Landmarks that the camera sees from there, if nothing hides them.
  std::vector<LandmarkId> landmarks_in_view(CameraKind camera, const Rigid3d& cam_from_world) const;

  // Writes the newest map. The file is whole, or as it was. Throws OutputError.
  void save(const std::filesystem::path& file) const;

  // What such a file says beside the map: the program, and all options as they were settled.
  MapFileInfo file_info() const;

  SessionCounts counts() const;
  std::optional<UpsamplingEvidence> upsampling() const;  // once it is settled
  bool upsamples() const;
  StageTimes times() const;  // after finish()

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace hybrid_slam
