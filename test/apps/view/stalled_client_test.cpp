// Clients that come and go, and one that takes nothing until all buffers are full.
#include <catch2/catch.hpp>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "apps/view/live_view.h"
#include "test/apps/view/http_client.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

// No JPEG becomes small of it.
GrayImage noise() {
  std::minstd_rand random(1);
  GrayImage image{1280, 960, std::vector<std::uint8_t>(1280 * 960)};
  for (std::uint8_t& pixel : image.pixels) pixel = static_cast<std::uint8_t>(random() >> 8);
  return image;
}

std::ptrdiff_t threads_of_this_process() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/task"), {});
}

template <typename Truth>
bool comes_true(const Truth& truth, Clock::duration patience) {
  const auto end = Clock::now() + patience;
  while (!truth()) {
    if (Clock::now() > end) return false;
    std::this_thread::sleep_for(2ms);
  }
  return true;
}

// A run that tells one frame after the other, and how long it was ever kept.
class Teller {
 public:
  explicit Teller(LiveFeed& feed) : feed_(feed) {}

  void tell() {
    FrameResult frame;
    frame.time = 1'000'000'000LL + 10'000'000LL * told_++;
    Moment moment;
    moment.inputs.push_back(StereoImages{frame.time, image_, image_});
    const auto begin = Clock::now();
    feed_.images(moment);
    feed_.frame(frame);
    const std::chrono::duration<double, std::milli> took = Clock::now() - begin;
    longest_ms_ = std::max(longest_ms_, took.count());
  }

  int told() const { return told_; }
  double longest_ms() const { return longest_ms_; }

 private:
  LiveFeed& feed_;
  const GrayImage image_ = noise();
  int told_ = 0;
  double longest_ms_ = 0;
};

}  // namespace

TEST_CASE("a client that takes nothing is dropped, and nobody waits for it", "[view]") {
  const auto threads = threads_of_this_process();
  LiveView view({"127.0.0.1", 0});
  view.begin({"a run", {synthetic_stereo_camera(0.2), synthetic_fisheye_camera()}});
  const std::string url = view.url();
  const int port = std::stoi(url.substr(url.rfind(':') + 1));
  const auto watchers = [&] { return view.feed().watchers(); };

  HttpClient stalled(port, "127.0.0.1", 2048);
  stalled.get("/events");
  REQUIRE(comes_true([&] { return watchers() == 1; }, 20s));
  HttpClient reader(port);
  reader.get("/events");
  REQUIRE(reader.event());  // the state
  int frames = 0, missed = 0;
  std::string last;
  std::thread reading([&] {
    while (const auto event = reader.event(30s)) {
      if (event->first == "frame") {
        ++frames;
        missed = nlohmann::json::parse(event->second)["missed"];
      }
      last = event->first;
    }
  });

  Teller teller(view.feed());
  std::size_t most = 0;
  const auto visitors_come_and_go = [&] {
    for (int i = 0; i < 10; ++i) {
      HttpClient visitor(port);
      visitor.get("/events");
      teller.tell();
      if (i % 2 == 0) visitor.event();
      most = std::max(most, watchers());
    }
  };
  visitors_come_and_go();
  // The stalled one is still connected: that it is no longer fed is our server's doing.
  const bool dropped = comes_true(
      [&] {
        teller.tell();
        return watchers() == 1;
      },
      30s);
  CHECK(dropped);
  CHECK(most > 2);
  const auto begin = Clock::now();
  view.end("it is done");
  const double end_s = std::chrono::duration<double>(Clock::now() - begin).count();
  reading.join();
  CHECK(frames + missed == teller.told());
  CHECK(last == "end");
  // Who waits for a client waits two seconds: far less, on a busy machine, too.
  CHECK(teller.longest_ms() < 1000);
  CHECK(end_s < 5);
  CHECK(threads_of_this_process() == threads);
}

}  // namespace hybrid_slam
