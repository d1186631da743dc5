// What may be wrong with frames, provoked one by one in images, must be named soon, and nothing of
// it where nothing is wrong.
#include <algorithm>
#include <catch2/catch.hpp>
#include <functional>
#include <map>
#include <string>
#include <utility>

#include "apps/slam/session.h"
#include "test/apps/small_recording.h"

namespace hybrid_slam {
namespace {

constexpr int kMoments = 24;
constexpr int kFaultFrom = 12;      // the moment from which something is wrong
constexpr double kNamedWithin = 2;  // [s]

const SmallRecording& recording() {
  static const SmallRecording made = make_small_recording(kMoments);
  return made;
}

SlamOptions small_options() {
  SlamOptions options;
  options.features = 400;
  options.distribute();
  return options;
}

// By cause, when it was first named [s], and by what was left out.
using Named = std::map<std::string, double>;

// What a fault does to the moment's inputs, in the order in which they are pushed.
using Fault = std::function<void(int moment, std::vector<SensorInput>& inputs)>;

Named run(const SmallRecording& images, const Fault& fault,
          SessionMode mode = SessionMode::kEveryFrame) {
  Named named;
  SessionObservers observers;
  observers.frame = [&](const FrameResult& frame) {
    for (const FoundCause& found : frame.causes) {
      CHECK_FALSE(describe(found).empty());
      named.try_emplace(to_string(found.cause), to_seconds(frame.time));
    }
  };
  SessionOptions options;
  options.mode = mode;
  options.drop = mode == SessionMode::kRealtime;
  Session session(images.cameras, small_options(), options, observers);
  for (int i = 0; i < kMoments; ++i) {
    const SmallRecording::Moment& moment = images.moments[static_cast<std::size_t>(i)];
    std::vector<SensorInput> inputs{moment.stereo, moment.fisheye};
    if (i >= kFaultFrom && fault) fault(i, inputs);
    for (SensorInput& input : inputs) {
      // The first images are never dropped.
      if (mode == SessionMode::kRealtime && i < 4) {
        session.track(std::move(input));
      } else {
        session.push(std::move(input));
      }
    }
  }
  session.finish();
  return named;
}

// What can be seen of it when it begins, not before.
void check_named(const Named& named, const std::string& cause, double begin) {
  INFO(cause);
  REQUIRE(named.contains(cause));
  CHECK(named.at(cause) >= begin - 1e-9);
  CHECK(named.at(cause) <= begin + kNamedWithin);
}

double fault_time() { return to_seconds(kFaultFrom * SmallRecording::kPeriod); }

StereoImages& stereo_of(std::vector<SensorInput>& inputs) {
  return std::get<StereoImages>(inputs.front());
}

void change(GrayImage& image, const std::function<int(int)>& grey) {
  for (std::uint8_t& pixel : image.pixels) {
    pixel = static_cast<std::uint8_t>(std::clamp(grey(pixel), 0, 255));
  }
}

void blur_rows(GrayImage& image, int width) {
  const GrayImage sharp = image;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      int sum = 0;
      for (int k = -width / 2; k <= width / 2; ++k) {
        sum += sharp.row(y)[std::clamp(x + k, 0, image.width - 1)];
      }
      image.row(y)[x] = static_cast<std::uint8_t>(sum / (2 * (width / 2) + 1));
    }
  }
}

TEST_CASE("Nothing is named where nothing is wrong", "[slam]") {
  const Named named = run(recording(), {});
  for (const auto& [cause, time] : named) FAIL_CHECK(cause << " at " << time << " s");
}

TEST_CASE("Faults of the images are named within two seconds", "[slam]") {
  const std::map<std::string, Fault> faults{
      {"dark",
       [](int, auto& inputs) {
         change(stereo_of(inputs).left, [](int grey) { return grey / 8; });
         change(stereo_of(inputs).right, [](int grey) { return grey / 8; });
       }},
      {"few_features",
       [](int, auto& inputs) { change(stereo_of(inputs).left, [](int) { return 120; }); }},
      {"saturated",
       [](int, auto& inputs) {
         change(stereo_of(inputs).left, [](int grey) { return grey * 3; });
       }},
      {"blurred",
       [](int, auto& inputs) {
         blur_rows(stereo_of(inputs).left, 15);
         blur_rows(stereo_of(inputs).right, 15);
       }},
      {"few_stereo_matches",
       [](int i, auto& inputs) {
         stereo_of(inputs).right =
             recording().moments[static_cast<std::size_t>(i - 12)].stereo.left;
       }},
      {"masked",
       [](int, auto& inputs) {
         GrayImage mask = stereo_of(inputs).left;
         for (int y = 0; y < mask.height; ++y) std::fill_n(mask.row(y), mask.width, 255 * (y < 80));
         stereo_of(inputs).mask = mask;
       }},
      {"fisheye_blind",
       [](int, auto& inputs) {
         change(std::get<FisheyeImage>(inputs.back()).image, [](int) { return 40; });
       }},
      {"frozen",
       [](int, auto& inputs) {
         stereo_of(inputs).left = recording().moments[kFaultFrom - 1].stereo.left;
       }},
      {"partner_missing", [](int, auto& inputs) { inputs.pop_back(); }},
      {"time_jump",
       [](int, auto& inputs) {
         stereo_of(inputs).time += 3'000'000'000;
         std::get<FisheyeImage>(inputs.back()).time += 3'000'000'000;
       }},
  };
  for (const auto& [cause, fault] : faults) {
    const double begin = fault_time() + (cause == "time_jump" ? 3 : 0);
    check_named(run(recording(), fault), cause, begin);
  }
}

TEST_CASE("Left and right swapped are named in the first second", "[slam]") {
  SmallRecording swapped = recording();
  for (auto& moment : swapped.moments) std::swap(moment.stereo.left, moment.stereo.right);
  const Named named = run(swapped, {});
  REQUIRE(named.contains("swapped"));
  CHECK(named.at("swapped") <= 1);
}

TEST_CASE("A right camera that is turned is named", "[slam]") {
  const Named named = run(make_small_recording(kMoments, 0.03), {});
  check_named(named, "calibration_doubtful", 0);
}

TEST_CASE("Times that run backwards are told in the first second", "[slam]") {
  for (const SessionMode mode : {SessionMode::kEveryFrame, SessionMode::kRealtime}) {
    std::optional<Nanoseconds> told;
    SessionObservers observers;
    observers.left_out = [&](const LeftOut& input) {
      CHECK(input.reason == std::string(to_string(PushResult::kLate)));
      if (!told) told = input.time;
    };
    SessionOptions options;
    options.mode = mode;
    options.drop = false;
    Session session(recording().cameras, small_options(), options, observers);
    for (int i = 0; i < 5; ++i) {
      StereoImages images = recording().moments[static_cast<std::size_t>(i)].stereo;
      images.time = 100'000'000'000 - images.time;
      session.push(std::move(images));
    }
    session.finish();
    REQUIRE(told.has_value());
    CHECK(to_seconds(100'000'000'000 - *told) <= 1);
  }
}

TEST_CASE("Disorder and frames that are left out for want of time are named", "[slam]") {
  // Of moment 14, which comes a second too late.
  SensorInput late = recording().moments[14].stereo;
  const Named disorder = run(recording(), [&](int i, auto& inputs) {
    if (i == 14) inputs.erase(inputs.begin());
    if (i == 19) inputs.insert(inputs.begin(), late);
  });
  check_named(disorder, "disorder", to_seconds(recording().moments[16].time));
  // Pushed without a pause, most are dropped; what is left says so.
  const Named behind = run(recording(), {}, SessionMode::kRealtime);
  CHECK(behind.contains("behind"));
}

}  // namespace
}  // namespace hybrid_slam
