#include "apps/slam/reorder_buffer.h"

#include <algorithm>

namespace hybrid_slam {
namespace {

// A clock that was set back: so many inputs in a row, of all cameras, are late by so much. No
// transport delays by that; a single wrong stamp is one input.
constexpr int kClockInputs = 3;
constexpr Nanoseconds kClockStep = 1'000'000'000;

}  // namespace

const char* to_string(PushResult result) {
  switch (result) {
    case PushResult::kTaken:
      return "taken";
    case PushResult::kLate:
      return "late";
    case PushResult::kDuplicate:
      return "duplicate";
    case PushResult::kWrongSize:
      return "wrong size";
    case PushResult::kNoCamera:
      return "no such camera";
    case PushResult::kClosed:
      break;
  }
  return "closed";
}

PushResult ReorderBuffer::add(SensorInput input, Clock::time_point arrival) {
  const Key key{time_of(input), camera_of(input)};
  if (waiting_.contains(key) || released_ == key) return PushResult::kDuplicate;
  if (released_ && key < *released_ && !begins_anew(key.first)) return PushResult::kLate;
  far_behind_ = 0;
  const auto newest = newest_.try_emplace(key.second, key.first).first;
  newest->second = std::max(newest->second, key.first);
  waiting_.emplace(key, Waiting{std::move(input), arrival});
  return PushResult::kTaken;
}

bool ReorderBuffer::begins_anew(Nanoseconds time) {
  const bool far = released_->first - time > std::max(kClockStep, 4 * options_.window);
  far_behind_ = far ? far_behind_ + 1 : 0;
  if (far_behind_ < kClockInputs) return false;
  released_.reset();
  newest_.clear();
  return true;
}

bool ReorderBuffer::is_due(const Key& key, const Waiting& waiting, Clock::time_point now) const {
  const auto passed = [&](CameraKind camera) {
    const auto newest = newest_.find(camera);
    return newest != newest_.end() && newest->second >= key.first;
  };
  for (const auto& [camera, newest] : newest_) {
    if (newest - key.first >= options_.window) return true;
  }
  if (!options_.early) return false;
  return (passed(CameraKind::kStereo) && (!fisheye_ || passed(CameraKind::kFisheye))) ||
         now - waiting.arrival >= std::chrono::nanoseconds(options_.window);
}

std::optional<SensorInput> ReorderBuffer::take(Clock::time_point now, bool flush) {
  if (waiting_.empty()) return std::nullopt;
  const auto first = waiting_.begin();
  if (!flush && !is_due(first->first, first->second, now)) return std::nullopt;
  released_ = first->first;
  SensorInput input = std::move(first->second.input);
  waiting_.erase(first);
  return input;
}

std::optional<ReorderBuffer::Clock::time_point> ReorderBuffer::next_due() const {
  if (waiting_.empty() || !options_.early) return std::nullopt;
  return waiting_.begin()->second.arrival + std::chrono::nanoseconds(options_.window);
}

}  // namespace hybrid_slam
