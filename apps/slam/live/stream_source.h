#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apps/slam/live/grabber.h"
#include "apps/slam/live/set_pairing.h"

namespace hybrid_slam {

struct StreamOptions {
  bool split = false;    // the left stream holds left and right image side by side
  bool realtime = true;  // videos come at their own pace, and nobody waits for the SLAM
  double timeout = 10;   // [s] in which each stream must deliver
  double tolerance = 0;  // [s] of videos: as match_stamps() takes it
};

// Sets from streams of which each has a thread. Cameras and networks are stamped when their images
// come; videos, if all are, by the times in them, begun at the run's start. A stream that is lost
// is said to be, once, and taken up again when it is back.
class StreamSource final : public SetSource {
 public:
  StreamSource(std::vector<StreamSpec> specs, const StreamOptions& options);
  ~StreamSource() override;

  std::optional<ImageSet> next(const std::stop_token& stop) override;
  LiveCounts counts() const override;

 private:
  using Clock = StreamClock::Clock;
  struct State {
    bool used = false;
    bool ends = false;   // it is a video in a file
    bool ended = false;  // and was read to its end
    bool delivered = false;
    bool lost = false;
    bool anew = false;  // opened again since its last image
    Clock::time_point last;
    double period = 0;  // [s] between its images, lately
    std::string name;
    std::string why;  // it cannot be opened
  };

  std::optional<ImageSet> take();
  PerCamera<bool> held() const;
  void handle(StreamEvent event);
  void add(LiveCamera camera, StampedImage image);
  void lose(LiveCamera camera, const std::string& why);
  void look_for_silence();
  void split(ImageSet& set) const;

  const StreamOptions options_;
  const bool keeps_all_;
  GrabOptions grab_;
  SetPairing pairing_;
  PerCamera<State> states_;
  LiveCounts counts_;
  bool over_ = false;
  std::shared_ptr<StreamInbox> inbox_;
  std::vector<std::unique_ptr<Grabber>> grabbers_;  // last: they end before the rest goes
};

}  // namespace hybrid_slam
