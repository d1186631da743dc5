#pragma once

#include <memory>
#include <string>

#include "apps/slam/replay.h"
#include "apps/view/http_server.h"

namespace hybrid_slam {

// What is known of a run before it begins.
struct LiveRun {
  std::string title;
  CameraRig cameras;
};

// What a run tells, for any number of watchers: text of server-sent events (docs/view.md has
// them). A watcher first gets the present state, and again if it was too slow for what came since.
//
// Who tells only copies and returns: a thread of its own does the rest, as much of it as somebody
// watches for. Where that thread is a thousand events behind, the next are left out and counted.
class LiveFeed {
 public:
  explicit LiveFeed(LiveRun run);
  ~LiveFeed();  // as end()

  // Any thread.
  void frame(const FrameResult& frame);
  void left_out(const LeftOut& input);
  void keyframe(const KeyframeResult& keyframe);  // of a frame that was told before
  void map(std::shared_ptr<const MapSnapshot> map, MapChange change);
  void loop(const LoopRecord& loop);

  // The images of a moment, before it is tracked. Where somebody watches, they are made smaller
  // and kept until their frame comes; of more than five moments a second, some are left out.
  void images(const Moment& moment);

  // A watcher, which may outlive this.
  std::unique_ptr<EventStream> watch();
  std::size_t watchers() const;

  // The run is over: watchers are told, with one line for people, and their streams end.
  void end(const std::string& text);

 private:
  class Work;
  class Watcher;
  std::shared_ptr<Work> work_;
};

}  // namespace hybrid_slam
