#include "apps/slam/live/grabber.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "cameras/files/input_error.h"

namespace hybrid_slam {
namespace {

using Clock = StreamClock::Clock;
using namespace std::chrono_literals;

constexpr auto kFirstPause = 250ms;  // before a stream is opened anew; doubled each time
constexpr auto kLongestPause = 5s;
constexpr int kKnown = 12;          // images after which its rate was right
constexpr auto kLongestBurst = 5s;  // what a connection holds at first comes sooner

class Listener {
 public:
  Listener(StreamSpec spec, std::shared_ptr<StreamInbox> inbox, const GrabOptions& options)
      : spec_(std::move(spec)), inbox_(std::move(inbox)), options_(options) {}

  void run() {
    auto pause = std::chrono::duration_cast<Clock::duration>(kFirstPause);
    while (true) {
      try {
        const auto stream = open();
        if (!stream) {
          if (!spec_.retries && !opened_) return;
        } else if (deliver(*stream)) {
          pause = kFirstPause;
        }
      } catch (const InputError& error) {
        tell(StreamEvent::Kind::kFailed, error.what());
        return;
      }
      if (opened_ && spec_.ends) {
        tell(StreamEvent::Kind::kEnded);
        return;
      }
      if (!inbox_->wait_until(Clock::now() + pause)) return;
      pause = std::min<Clock::duration>(2 * pause, kLongestPause);
    }
  }

 private:
  bool tell(StreamEvent::Kind kind, const std::string& text = {}) {
    return inbox_->put({spec_.camera, kind, {}, text});
  }

  std::unique_ptr<ImageStream> open() {
    try {
      auto stream = spec_.open();
      opened_ = true;
      tell(StreamEvent::Kind::kOpened);
      return stream;
    } catch (const InputError& error) {
      const bool hopeless = !spec_.retries && !opened_;
      tell(hopeless ? StreamEvent::Kind::kFailed : StreamEvent::Kind::kLost, error.what());
      return nullptr;
    }
  }

  // Whether there were any images.
  bool deliver(ImageStream& stream) {
    const double rate = spec_.rate > 0 ? spec_.rate : stream.rate();
    const std::chrono::duration<double> least(rate > 0 ? 0.5 / rate : 0);
    auto last = Clock::now();
    auto last_good = last;
    bool any = false;
    while (std::optional<StreamImage> image = stream.next()) {
      const auto now = image->time;
      const bool held_up = !options_.by_position && now - std::exchange(last, now) < least;
      if (held_up) {
        inbox_->count_held_up(spec_.camera);
        if (good_ >= kKnown || now - last_good < kLongestBurst) continue;
        throw InputError(spec_.name + ": its images come more than twice as fast as " +
                         std::to_string(rate) + " Hz, which " +
                         (spec_.rate > 0 ? "it should have" : "it says it has") + " (--rate-hint)");
      }
      last_good = now;
      any = true;
      ++good_;
      if (!put(std::move(*image), now)) return any;
    }
    if (!spec_.ends) tell(StreamEvent::Kind::kLost, spec_.name + ": broke off");
    return any;
  }

  bool put(StreamImage image, Clock::time_point now) {
    std::int64_t stamp = options_.clock.stamp(now);
    if (image.position) {
      const std::chrono::duration<double> position(*image.position);
      const auto due = options_.clock.start + std::chrono::duration_cast<Clock::duration>(position);
      if (options_.paced && !inbox_->wait_until(due)) return false;
      stamp = options_.clock.stamp(options_.by_position ? due : Clock::now());
    }
    return inbox_->put(
        {spec_.camera, StreamEvent::Kind::kImage, {stamp, std::move(image.image), {}}, {}});
  }

  const StreamSpec spec_;
  const std::shared_ptr<StreamInbox> inbox_;
  const GrabOptions options_;
  bool opened_ = false;  // once
  int good_ = 0;         // images that were not held up
};

}  // namespace

Grabber::Grabber(StreamSpec spec, std::shared_ptr<StreamInbox> inbox, const GrabOptions& options) {
  std::promise<void> ended;
  ended_ = ended.get_future();
  thread_ = std::thread([listener = Listener(std::move(spec), std::move(inbox), options),
                         ended = std::move(ended)]() mutable {
    listener.run();
    ended.set_value();
  });
}

Grabber::~Grabber() {
  constexpr auto kPatience = 3s;
  if (ended_.wait_for(kPatience) == std::future_status::ready) {
    thread_.join();
  } else {
    thread_.detach();
  }
}

}  // namespace hybrid_slam
