// What is told to who watches a run.
#include <catch2/catch.hpp>

#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "apps/slam/broadcast.h"
#include "apps/view/live_feed.h"
#include "apps/view/live_picture.h"
#include "test/support/filled_map.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::json;
using namespace std::chrono_literals;

Broadcast::Text text(const std::string& content) {
  return std::make_shared<const std::string>(content);
}

FrameResult frame_at(int number, TrackingState state = TrackingState::kMap) {
  FrameResult frame;
  frame.time = 1'000'000'000LL + 250'000'000LL * number;
  frame.state = state;
  frame.features = 900 + number;
  frame.stereo_matches = 500;
  if (state == TrackingState::kLost) {
    frame.causes = {{Cause::kDark, 13}};
    return frame;
  }
  frame.tracked.source = PoseSource::kLocalMap;
  frame.tracked.inliers = 300 + number;
  frame.tracked.cam_from_world =
      inverse(Rigid3d(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.1 * number, 0, 0)));
  return frame;
}

// The events in what a watcher gets next that is not empty: name and data.
std::vector<std::pair<std::string, Json>> next_events(EventStream& watcher) {
  std::vector<std::pair<std::string, Json>> events;
  for (int i = 0; i < 20 && events.empty(); ++i) {
    const auto got = watcher.next();
    if (got == nullptr) break;
    std::string rest = *got;
    for (std::size_t end = rest.find("\n\n"); end != std::string::npos; end = rest.find("\n\n")) {
      const std::string block = rest.substr(0, end);
      rest.erase(0, end + 2);
      const std::size_t name = block.find("event: "), data = block.find("\ndata: ");
      if (name == std::string::npos) continue;
      events.emplace_back(block.substr(name + 7, data - name - 7),
                          Json::parse(block.substr(data + 7)));
    }
  }
  return events;
}

std::pair<std::string, Json> next_event(EventStream& watcher) {
  const auto events = next_events(watcher);
  return events.empty() ? std::pair<std::string, Json>() : events.front();
}

// {"type": "f32", "data": base64}.
std::vector<float> floats(const Json& array) {
  REQUIRE(array["type"] == "f32");
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned bits = 0;
  int count = 0;
  for (const char c : array["data"].get<std::string>()) {
    if (c == '=') break;
    bits = bits << 6 | static_cast<unsigned>(digits.find(c));
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes += static_cast<char>(bits >> count & 255);
  }
  std::vector<float> values(bytes.size() / sizeof(float));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(float));
  return values;
}

LiveRun hybrid_run() {
  return {"a run", {synthetic_stereo_camera(0.2), synthetic_fisheye_camera()}};
}

FilledMap small_map() {
  SyntheticSceneOptions options;
  options.times = 6;
  options.noise = 0;
  options.landmarks = 300;
  return fill_map(make_synthetic_scene(options), {});
}

}  // namespace

TEST_CASE("each reader of a broadcast is at its own place, and told what it missed", "[view]") {
  Broadcast broadcast(10);
  std::uint64_t first = 0, second = 0;
  broadcast.publish(text("12345"));
  broadcast.publish(text("6789"));
  CHECK(*broadcast.next(first, 0ms).text == "12345");
  CHECK(*broadcast.next(first, 0ms).text == "6789");
  CHECK(broadcast.next(first, 0ms).what == Broadcast::What::kNothing);
  broadcast.publish(text("abc"));  // 12 bytes: the oldest goes
  CHECK(broadcast.next(second, 0ms).what == Broadcast::What::kMissed);
  CHECK(*broadcast.next(first, 0ms).text == "abc");
  broadcast.publish(text(std::string(100, 'x')));  // larger than all: it alone is kept
  CHECK(broadcast.next(first, 0ms).text->size() == 100);
  second = broadcast.end() - 1;
  broadcast.close();
  broadcast.publish(text("late"));
  CHECK(broadcast.next(second, 0ms).what == Broadcast::What::kText);
  CHECK(broadcast.next(second, 0ms).what == Broadcast::What::kOver);
}

TEST_CASE("a watcher gets the present state, then what happens", "[view]") {
  LiveFeed feed(hybrid_run());
  for (int i = 0; i < 4; ++i) feed.frame(frame_at(i));
  feed.frame(frame_at(4, TrackingState::kLost));
  feed.left_out({CameraKind::kFisheye, 2'000'000'000LL, kDropped});
  const auto watcher = feed.watch();
  const auto [name, state] = next_event(*watcher);
  REQUIRE(name == "state");
  CHECK(state["title"] == "a run");
  CHECK(state["frames"]["count"] == 6);
  CHECK(state["frames"]["states"] == Json({"map", "lost", "dropped"}));
  CHECK(state["frames"]["causes"]["4"] == "dark=13");
  CHECK(state["losses"].size() == 1);
  CHECK(state["missed"] == 0);

  feed.frame(frame_at(5));
  const auto [kind, frame] = next_event(*watcher);
  REQUIRE(kind == "frame");
  CHECK(frame["camera"] == 0);
  CHECK(frame["time"] == 2.25);
  CHECK(frame["state"] == "map");
  CHECK(frame["features"] == 905);
  CHECK(frame["inliers"] == 305);
  CHECK(frame["position"][0].get<double>() == Approx(0.5));
  CHECK(frame["sigma_position"] == 0.0);
  CHECK(frame["component"].is_null());

  feed.frame(frame_at(6, TrackingState::kLost));
  const Json lost = next_event(*watcher).second;
  CHECK(lost["position"].is_null());
  CHECK(lost["causes"] == "dark=13");

  feed.end("it is done");
  const auto [last, over] = next_event(*watcher);
  CHECK(last == "end");
  CHECK(over["text"] == "it is done");
  CHECK(watcher->next() == nullptr);
  CHECK(feed.watch()->next() == nullptr);
}

TEST_CASE("a map is told whole, then what changed of it", "[view]") {
  FilledMap filled = small_map();
  LiveFeed feed(hybrid_run());
  feed.map(filled.map.snapshot(), MapChange::kKeyframe);
  feed.frame(frame_at(0));
  const auto watcher = feed.watch();
  const Json state = next_event(*watcher).second;
  CHECK(state["landmarks"]["count"] == filled.map.view().landmark_count());
  CHECK(state["keyframes"]["count"] == filled.map.view().keyframe_count());
  CHECK(state["landmarks"]["erased"]["data"] == "");

  const LandmarkId gone = filled.map.view().landmark_ids().front();
  MapEdit edit;
  edit.erased_landmarks.push_back(gone);
  filled.map.apply(edit);
  std::this_thread::sleep_for(1100ms);  // the map is told once a second
  feed.map(filled.map.snapshot(), MapChange::kKeyframe);
  feed.frame(frame_at(1));
  CHECK(next_event(*watcher).first == "frame");
  const auto [name, change] = next_event(*watcher);
  REQUIRE(name == "map");
  CHECK(change["landmarks"]["of"] == filled.map.view().landmark_count());
  CHECK(change["landmarks"]["erased"]["data"] != "");
  CHECK(change["landmarks"]["count"] < 10);
  // A loop moves frames as well: all is told again.
  feed.map(filled.map.snapshot(), MapChange::kLoop);
  feed.end("");
  CHECK(next_event(*watcher).first == "state");
}

TEST_CASE("a frame that begins a component moves with its keyframe", "[view]") {
  FilledMap filled = small_map();
  const MapSnapshot& map = filled.map.view();
  LiveFeed feed(hybrid_run());
  FrameResult first = frame_at(0, TrackingState::kStarting);
  first.index = 8;
  first.tracked.source = PoseSource::kInitialization;
  first.tracked.cam_from_world = map.cam_from_world(map.origin());
  feed.frame(first);
  first.camera = CameraKind::kFisheye;  // of the same moment, and no keyframe
  feed.frame(first);
  feed.keyframe({CameraKind::kStereo, 8, map.origin()});
  feed.keyframe({CameraKind::kStereo, 9, map.keyframe_ids().back()});  // of no frame that was told

  // Another component takes it up.
  const Rigid3d moved(Eigen::Quaterniond(0.6, 0, 0.8, 0), Eigen::Vector3d(3, -2, 5));
  filled.map.move({{map.origin(), moved}}, {});
  feed.map(filled.map.snapshot(), MapChange::kLoop);
  const auto watcher = feed.watch();
  const Json frames = next_event(*watcher).second["frames"];
  const Eigen::Vector3d now = inverse(moved).translation();
  const Eigen::Vector3d told = inverse(first.tracked.cam_from_world).translation();
  const std::vector<float> positions = floats(frames["position"]);
  REQUIRE(positions.size() == 6);
  for (int k = 0; k < 3; ++k) {
    CHECK(positions[static_cast<std::size_t>(k)] == Approx(now[k]));
    CHECK(positions[static_cast<std::size_t>(3 + k)] == Approx(told[k]).margin(1e-6));
  }
}

TEST_CASE("images are kept while somebody watches, and told with their frame", "[view]") {
  const FilledMap filled = small_map();
  LiveFeed feed(hybrid_run());
  const auto moment = [](int number) {
    GrayImage image{1280, 960, std::vector<std::uint8_t>(1280 * 960, 90)};
    Moment made;
    made.inputs.push_back(StereoImages{frame_at(number).time, image, image});
    return made;
  };
  feed.images(moment(0));
  feed.frame(frame_at(0));
  const auto watcher = feed.watch();
  CHECK(next_events(*watcher).size() == 1);  // the state alone
  CHECK(feed.watchers() == 1);
  const auto clock = [] {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    return std::chrono::duration<double>(now).count();
  };
  const double before = clock();
  feed.images(moment(1));
  const double between = clock();
  feed.frame(frame_at(1));
  const auto [kind, frame] = next_event(*watcher);
  REQUIRE(kind == "frame");
  CHECK(frame["pushed"].get<double>() >= before);
  CHECK(frame["pushed"].get<double>() <= between);
  CHECK(frame["told"].get<double>() >= between);
  const auto [name, picture] = next_event(*watcher);
  REQUIRE(name == "picture");
  CHECK(picture["width"] == 640);
  CHECK(picture["height"] == 480);
  CHECK(picture["time"] == 1.25);
  CHECK(picture["camera"] == 0);
  CHECK(picture["pushed"] == frame["pushed"]);
  feed.images(moment(2));  // too soon for another picture
  feed.frame(frame_at(2));
  feed.frame(frame_at(3));  // nobody said when it was handed over
  CHECK(next_event(*watcher).second["pushed"].get<double>() >= between);
  CHECK(next_event(*watcher).second["pushed"].is_null());
  const auto late = feed.watch();
  CHECK(next_events(*late).size() == 2);  // the state and the newest picture
}

TEST_CASE("found landmarks lie where the camera sees them, as shares of the image", "[view]") {
  FilledMap filled = small_map();
  const MapSnapshot& map = filled.map.view();
  const Keyframe& keyframe = map.at(map.origin());
  TrackedFrame frame;
  frame.source = PoseSource::kLocalMap;
  frame.cam_from_world = keyframe.cam_from_world;
  std::vector<Eigen::Vector2d> expected;
  for (std::size_t i = 0; i < keyframe.landmarks.size() && expected.size() < 5; ++i) {
    if (!keyframe.landmarks[i].valid()) continue;
    frame.counts.found.push_back(keyframe.landmarks[i]);
    const Keypoint& keypoint = keyframe.observations->features.keypoints[i];
    expected.emplace_back(keypoint.x, keypoint.y);
  }
  REQUIRE(expected.size() == 5);
  const Camera model = map.camera(keyframe);
  const GrayImage image{64, 48, std::vector<std::uint8_t>(64 * 48, 90)};
  const Json json =
      Json(picture_json(CameraKind::kStereo, 0, image, frame, model, &map))["features"];
  const std::vector<float> shares = floats(json);
  REQUIRE(shares.size() == 10);
  const double width = image_width(model), height = image_height(model);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    CHECK(width * shares[2 * i] - 0.5 == Approx(expected[i].x()).margin(0.5));
    CHECK(height * shares[2 * i + 1] - 0.5 == Approx(expected[i].y()).margin(0.5));
  }
  const Json none = picture_json(CameraKind::kStereo, 0, image, frame, model, nullptr);
  CHECK(none["features"]["data"] == "");
}

TEST_CASE("a small image is the mean of four pixels, as often as it must be", "[view]") {
  GrayImage image{1700, 4, std::vector<std::uint8_t>(1700 * 4, 0)};
  image.row(0)[0] = 100;
  image.row(1)[1] = 60;
  const GrayImage small = small_image(image);
  CHECK(small.width == 425);  // 850 is still too wide
  CHECK(small.height == 1);
  CHECK(small.row(0)[0] == 10);  // 40 / 4
  CHECK(small_image(GrayImage{800, 1, std::vector<std::uint8_t>(800, 7)}).width == 800);
}

}  // namespace hybrid_slam
