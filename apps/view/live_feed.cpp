#include "apps/view/live_feed.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <variant>

#include "apps/slam/background.h"
#include "apps/slam/broadcast.h"
#include "apps/slam/channel.h"
#include "apps/view/live_picture.h"
#include "apps/view/live_state.h"

namespace hybrid_slam {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;
using Text = Broadcast::Text;
using namespace std::chrono_literals;

constexpr std::size_t kEvents = 1000;              // that wait for the thread
constexpr std::size_t kImages = 16;                // moments' images only wait behind fewer events
constexpr std::size_t kBytesKept = 8 << 20;        // of texts that were sent, for who is slow
constexpr Clock::duration kBetweenImages = 190ms;  // five times a second, with some tolerance
constexpr Clock::duration kBetweenMaps = 1s;
constexpr Clock::duration kBetweenStates = 5s;

// What is told, with when it was [s since 1970]: for who measures how long it takes to a page.
struct TrackedEvent {
  FrameResult frame;
  double told = 0;
};
struct ImageEvent {
  CameraKind camera = CameraKind::kStereo;
  Nanoseconds time = 0;
  double pushed = 0;  // as TrackedEvent::told
  GrayImage image;    // empty: not to be shown
};
struct MapEvent {
  std::shared_ptr<const MapSnapshot> map;
  MapChange change = MapChange::kKeyframe;
};
struct EndEvent {
  std::string text;
};
// The present state, and the place in the broadcast from which on it is to be gone on with.
struct State {
  Text text;
  std::uint64_t place = 0;
};
struct StateRequest {
  std::shared_ptr<Channel<State>> answer;
};
using Event = std::variant<TrackedEvent, LeftOut, ImageEvent, KeyframeResult, MapEvent, LoopRecord,
                           StateRequest, EndEvent>;

double now_since_1970() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace

class LiveFeed::Work {
 public:
  explicit Work(LiveRun run) : cameras_(run.cameras), state_(std::move(run.title)) {
    thread_.emplace("view feed", [this] { work(); });
  }

  void tell(Event event) {
    if (!events_.try_push(std::move(event))) ++missed_;
  }

  void frame(const FrameResult& frame) {
    TrackedEvent event{frame, now_since_1970()};
    if (watchers_ == 0) event.frame.tracked.counts.found = {};
    tell(std::move(event));
  }

  // One thread at a time.
  void images(const Moment& moment) {
    if (watchers_ == 0) return;
    const double pushed = now_since_1970();
    const Clock::time_point now = Clock::now();
    const bool shown = now - last_images_ >= kBetweenImages && events_.size() <= kImages;
    if (shown) last_images_ = now;
    for (const SensorInput& input : moment.inputs) {
      const GrayImage* image = nullptr;
      if (const auto* const pair = std::get_if<StereoImages>(&input)) image = &pair->left;
      if (const auto* const fisheye = std::get_if<FisheyeImage>(&input)) image = &fisheye->image;
      if (image == nullptr || image->empty()) continue;
      events_.try_push(ImageEvent{camera_of(input), time_of(input), pushed,
                                  shown ? small_image(*image) : GrayImage()});
    }
  }

  // Waits until all that was told before is told to the watchers.
  void end(const std::string& text) {
    events_.push(EndEvent{text});
    events_.close();
    thread_.reset();
    broadcast_.close();
  }

  // None where the run is over.
  std::optional<State> present_state() {
    const auto answer = std::make_shared<Channel<State>>(1);
    if (!events_.push(StateRequest{answer})) return std::nullopt;
    return answer->pop();
  }

  const Broadcast& broadcast() const { return broadcast_; }
  std::atomic<std::size_t>& watchers() { return watchers_; }

 private:
  void work() {
    while (auto event = events_.pop()) {
      if (watchers_ == 0) stop_showing();
      try {
        std::visit([this](auto& what) { take(what); }, *event);
      } catch (const std::exception& error) {
        give_up(*event, error.what());
      }
    }
  }

  // A bug of ours: the run goes on, and nobody can watch it any more.
  void give_up(Event& event, const char* why) {
    spdlog::warn("the live page has failed and is shut: {}", why);
    events_.close();
    broadcast_.close();
    answer_nothing(event);
    while (auto rest = events_.pop()) answer_nothing(*rest);
  }

  static void answer_nothing(Event& event) {
    if (auto* const request = std::get_if<StateRequest>(&event)) request->answer->close();
  }

  void stop_showing() {
    shown_.reset();
    images_.clear();
    for (Text& picture : pictures_) picture.reset();
  }

  void take(TrackedEvent& event) {
    const FrameResult& result = event.frame;
    state_.add(live_frame(result));
    if (watchers_ == 0) return;
    Json json = frame_json(state_.newest());
    json["missed"] = missed_.load();
    const auto image = std::find_if(images_.begin(), images_.end(), [&](const ImageEvent& its) {
      return its.camera == result.camera && its.time == result.time;
    });
    json["pushed"] = image == images_.end() ? Json() : Json(image->pushed);
    json["told"] = event.told;
    send("frame", json);
    if (image != images_.end() && !image->image.empty()) show_picture(event, *image);
    forget_images(result);
    show_map();
  }

  void take(LeftOut& input) {
    state_.add(live_frame(input));
    if (watchers_ > 0) send("frame", frame_json(state_.newest()));
  }

  void take(ImageEvent& event) { images_.push_back(std::move(event)); }

  void take(KeyframeResult& keyframe) { state_.add(keyframe); }

  void take(MapEvent& event) {
    map_ = std::move(event.map);
    // Frames follow, too.
    if (event.change != MapChange::kKeyframe) state_is_due_ = true;
  }

  void take(LoopRecord& loop) {
    loop.verification.loop.reset();  // large, and not told
    state_.add(loop);
    if (watchers_ > 0) send("loop", loop_json(loop));
  }

  void take(StateRequest& request) {
    if (shown_ == nullptr) begin_to_show();
    std::string text = whole_state();
    for (const Text& picture : pictures_) {
      if (picture != nullptr) text += *picture;
    }
    request.answer->push({text_to_send(std::move(text)), broadcast_.end()});
  }

  void take(EndEvent& event) {
    if (watchers_ > 0) {
      last_map_ = last_state_ = {};
      show_map();
    }
    send("end", {{"text", event.text}});
  }

  static Text text_to_send(std::string text) {
    return std::make_shared<const std::string>(std::move(text));
  }

  static std::string text_of(const char* name, const Json& data) {
    return event_text(name, data.dump(-1, ' ', false, Json::error_handler_t::replace));
  }

  void send(const char* name, const Json& data) {
    broadcast_.publish(text_to_send(text_of(name, data)));
  }

  void begin_to_show() {
    shown_ = map_;
    steps_ = map_ ? live_steps(*map_) : LiveSteps();
    state_is_due_ = false;
  }

  // Browsers that lose the connection try again after a second.
  std::string whole_state() const {
    return "retry: 1000\n" + text_of("state", state_.json(shown_.get(), steps_, missed_.load()));
  }

  // What became of the map, now and then: changes, or all of it.
  void show_map() {
    const Clock::time_point now = Clock::now();
    if (map_ == nullptr || now - last_map_ < kBetweenMaps) return;
    if (map_ == shown_ && !state_is_due_) return;
    last_map_ = now;
    const bool whole = shown_ == nullptr || live_steps(*map_) != steps_ || state_is_due_;
    if (whole && now - last_state_ >= kBetweenStates) {
      begin_to_show();
      last_state_ = now;
      broadcast_.publish(text_to_send(whole_state()));
    } else if (!whole) {
      const Json change = live_map_change_json(*map_, *shown_, steps_);
      shown_ = map_;
      if (!change.is_null()) send("map", change);
    }
  }

  void show_picture(const TrackedEvent& event, const ImageEvent& shown) {
    const FrameResult& frame = event.frame;
    const bool stereo = frame.camera == CameraKind::kStereo;
    if (!stereo && !cameras_.fisheye) return;
    const Camera model = stereo ? Camera(cameras_.stereo) : Camera(*cameras_.fisheye);
    Json json = picture_json(frame.camera, to_seconds(frame.time), shown.image, frame.tracked,
                             model, map_.get());
    json["pushed"] = shown.pushed;
    json["told"] = event.told;
    Text& picture = pictures_[stereo ? 0 : 1];
    picture = text_to_send(text_of("picture", json));
    broadcast_.publish(picture);
  }

  // Older ones of frames that never came, too: frames come in the order of their times.
  void forget_images(const FrameResult& frame) {
    std::erase_if(images_, [&](const ImageEvent& image) {
      return image.time < frame.time || (image.time == frame.time && image.camera == frame.camera);
    });
  }

  const CameraRig cameras_;
  Channel<Event> events_{kEvents};
  Broadcast broadcast_{kBytesKept};
  std::atomic<std::size_t> watchers_ = 0;
  std::atomic<std::size_t> missed_ = 0;
  Clock::time_point last_images_;  // of who hands them in

  // All below: the thread's own.
  LiveState state_;
  std::shared_ptr<const MapSnapshot> map_;    // the newest
  std::shared_ptr<const MapSnapshot> shown_;  // that all watchers have; null: no one has any
  LiveSteps steps_;                           // with which
  bool state_is_due_ = false;                 // more has moved than changes tell
  Clock::time_point last_map_, last_state_;
  std::vector<ImageEvent> images_;  // whose frames have not come
  std::array<Text, 2> pictures_;    // the newest, by camera
  std::optional<Background> thread_;
};

// At its place in the broadcast.
class LiveFeed::Watcher final : public EventStream {
 public:
  explicit Watcher(std::shared_ptr<Work> work) : work_(std::move(work)) { ++work_->watchers(); }
  ~Watcher() override { --work_->watchers(); }

  Text next() override {
    if (!place_) return begin();
    const Broadcast::Next next = work_->broadcast().next(*place_, 1s);
    switch (next.what) {
      case Broadcast::What::kText:
        return next.text;
      case Broadcast::What::kNothing:
        return std::make_shared<const std::string>();
      case Broadcast::What::kMissed:
        return begin();
      case Broadcast::What::kOver:
        break;
    }
    return nullptr;
  }

 private:
  Text begin() {
    auto state = work_->present_state();
    if (!state) return nullptr;
    place_ = state->place;
    return state->text;
  }

  std::shared_ptr<Work> work_;
  std::optional<std::uint64_t> place_;  // none before the state
};

LiveFeed::LiveFeed(LiveRun run) : work_(std::make_shared<Work>(std::move(run))) {}
LiveFeed::~LiveFeed() { end(""); }

void LiveFeed::frame(const FrameResult& frame) { work_->frame(frame); }
void LiveFeed::left_out(const LeftOut& input) { work_->tell(input); }
void LiveFeed::keyframe(const KeyframeResult& keyframe) { work_->tell(keyframe); }
void LiveFeed::loop(const LoopRecord& loop) { work_->tell(loop); }
void LiveFeed::images(const Moment& moment) { work_->images(moment); }
void LiveFeed::end(const std::string& text) { work_->end(text); }
std::size_t LiveFeed::watchers() const { return work_->watchers(); }

void LiveFeed::map(std::shared_ptr<const MapSnapshot> map, MapChange change) {
  work_->tell(MapEvent{std::move(map), change});
}

std::unique_ptr<EventStream> LiveFeed::watch() { return std::make_unique<Watcher>(work_); }

}  // namespace hybrid_slam
