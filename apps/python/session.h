#pragma once

#include <array>
#include <deque>
#include <limits>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "apps/python/conversions.h"
#include "apps/slam/channel.h"
#include "apps/slam/recorder.h"
#include "apps/slam/session.h"

namespace hybrid_slam::python {

// A Session in Python. Nothing of Python is called in the session's threads: what they tell waits
// in a queue until Python asks.
class PythonSession {
 public:
  static constexpr std::size_t kKept = 10'000;  // results that nobody asked for

  PythonSession(const CameraRig& cameras, const SlamOptions& options, SessionOptions session,
                Map map);
  ~PythonSession();

  // These run without the GIL.
  std::string push(SensorInput input);
  std::optional<FrameResult> track(SensorInput input);
  void finish();
  void save(const std::string& path) const;

  std::vector<FrameResult> results();  // since the last call
  std::vector<std::string> failures();
  Path trajectory(CameraKind camera, bool online);

  Session& session() { return *session_; }

 private:
  using Event = std::variant<FrameResult, KeyframeResult, SessionFailure>;

  SessionObservers observers();
  void drain();

  Channel<Event> events_{std::numeric_limits<std::size_t>::max()};
  ReplayHooks hooks_;
  RunResult result_;
  std::array<Path, 2> online_;  // as each frame was when it was tracked; by camera
  Recorder recorder_{result_, hooks_, 0};
  std::deque<FrameResult> unread_;
  std::vector<std::string> failures_;
  std::unique_ptr<Session> session_;  // last: its threads end before the rest goes
};

void bind_frame_result(py::module_& module);

}  // namespace hybrid_slam::python
