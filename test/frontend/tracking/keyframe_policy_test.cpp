#include "frontend/tracking/keyframe_policy.h"

#include <catch2/catch.hpp>
#include <limits>

namespace hybrid_slam {
namespace {

// A frame that needs no keyframe; each row below changes what it names.
KeyframeEvidence quiet() {
  KeyframeEvidence evidence;
  evidence.inliers = 400;
  evidence.reference_landmarks = 500;
  evidence.overlap = 0.95;
  evidence.new_ground = 0.05;
  evidence.close_tracked = 300;
  evidence.close_untracked = 30;
  evidence.frames_since_keyframe = 5;
  evidence.seconds_since_keyframe = 1;
  evidence.keyframes = 10;
  evidence.motion = 0.1;
  return evidence;
}

TEST_CASE("When a frame becomes a keyframe") {
  struct Row {
    const char* name;
    void (*change)(KeyframeEvidence&);
    bool expected;
  };
  const Row rows[] = {
      {"nothing to gain", [](KeyframeEvidence&) {}, false},
      {"share tracked just above 0.65", [](KeyframeEvidence& e) { e.inliers = 326; }, false},
      {"share tracked just below 0.65", [](KeyframeEvidence& e) { e.inliers = 324; }, true},
      {"a young map bears 0.4",
       [](KeyframeEvidence& e) {
         e.keyframes = 1;
         e.inliers = 201;
       },
       false},
      {"overlap just above 0.85", [](KeyframeEvidence& e) { e.overlap = 0.851; }, false},
      {"overlap just below 0.85", [](KeyframeEvidence& e) { e.overlap = 0.849; }, true},
      {"left behind, but well seen",
       [](KeyframeEvidence& e) {
         e.overlap = 0.6;
         e.inliers = 196;
         e.seconds_since_keyframe = 60;
         e.is_redundant = true;
       },
       false},
      {"well seen, but not found again",
       [](KeyframeEvidence& e) {
         e.overlap = 0.6;
         e.inliers = 194;
         e.is_redundant = true;
       },
       true},
      {"well seen, beside new ground",
       [](KeyframeEvidence& e) {
         e.new_ground = 0.151;
         e.is_redundant = true;
       },
       true},
      {"new ground just below 0.15", [](KeyframeEvidence& e) { e.new_ground = 0.149; }, false},
      {"new ground just above 0.15", [](KeyframeEvidence& e) { e.new_ground = 0.151; }, true},
      {"hardly tracked at all", [](KeyframeEvidence& e) { e.inliers = 15; }, false},
      {"just tracked", [](KeyframeEvidence& e) { e.inliers = 16; }, true},
      {"few close points, many to be had",
       [](KeyframeEvidence& e) {
         e.close_tracked = 199;
         e.close_untracked = 61;
       },
       true},
      {"few close points, few to be had",
       [](KeyframeEvidence& e) {
         e.close_tracked = 199;
         e.close_untracked = 60;
       },
       false},
      {"close points enough",
       [](KeyframeEvidence& e) {
         e.close_tracked = 200;
         e.close_untracked = 500;
       },
       false},
      {"many frames ago, but not long", [](KeyframeEvidence& e) { e.frames_since_keyframe = 1000; },
       false},
      {"long ago and moving", [](KeyframeEvidence& e) { e.seconds_since_keyframe = 5; }, true},
      {"long ago and standing",
       [](KeyframeEvidence& e) {
         e.seconds_since_keyframe = 100;
         e.motion = 0.019;
       },
       false},
      {"the odometer alone holds the track",
       [](KeyframeEvidence& e) {
         e.by_odometry = true;
         e.inliers = 0;
       },
       true},
  };
  for (const Row& row : rows) {
    KeyframeEvidence evidence = quiet();
    row.change(evidence);
    INFO(row.name);
    CHECK(needs_keyframe(evidence, 2000, {}) == row.expected);
  }
}

TEST_CASE("A limit in frames holds where it is asked for, and a young map has a ratio of its own") {
  KeyframePolicyOptions options;
  options.max_frames_between = 5;
  CHECK(needs_keyframe(quiet(), 2000, options));
  options.max_frames_between = 6;
  CHECK_FALSE(needs_keyframe(quiet(), 2000, options));
  options.min_tracked_ratio_young = 0.9;
  KeyframeEvidence young = quiet();
  young.keyframes = 1;
  CHECK(needs_keyframe(young, 2000, options));
}

TEST_CASE("Keyframe options out of range are refused") {
  CHECK(KeyframePolicyOptions{}.validate().empty());
  for (const double ratio : {0.0, 1.1, std::numeric_limits<double>::quiet_NaN()}) {
    KeyframePolicyOptions options;
    options.min_tracked_ratio = ratio;
    CHECK(!options.validate().empty());
  }
  for (double KeyframePolicyOptions::*const share :
       {&KeyframePolicyOptions::min_overlap, &KeyframePolicyOptions::max_new_ground,
        &KeyframePolicyOptions::max_seconds_between}) {
    KeyframePolicyOptions options;
    options.*share = -0.1;
    CHECK(!options.validate().empty());
  }
  KeyframePolicyOptions options;
  options.max_frames_between = -1;
  CHECK(!options.validate().empty());
}

}  // namespace
}  // namespace hybrid_slam
