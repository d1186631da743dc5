#include "apps/slam/session_log.h"

#include <fmt/format.h>

#include <utility>

#include "apps/slam/log.h"

namespace hybrid_slam {
namespace {

bool is_power_of_two(std::size_t n) { return (n & (n - 1)) == 0; }

bool anything_is_logged() {
  for (const LogRoom room : {LogRoom::kInput, LogRoom::kTracking, LogRoom::kMapping,
                             LogRoom::kLoops, LogRoom::kSession}) {
    if (log_of(room).level() != spdlog::level::off) return true;
  }
  return false;
}

std::string names_of(const std::vector<FoundCause>& causes) {
  std::string names;
  for (const FoundCause& found : causes) names += std::string(" ") + to_string(found.cause);
  return names;
}

std::string words_of(const std::vector<FoundCause>& causes) {
  std::string words;
  for (const FoundCause& found : causes) words += (words.empty() ? "" : "; ") + describe(found);
  return words;
}

std::string counts_of(const FrameResult& frame) {
  return fmt::format("{} features, {} stereo matches, {} inliers in the motion, {} in the pose",
                     frame.features, frame.stereo_matches, frame.tracked.odometer_inliers,
                     frame.tracked.inliers);
}

// Calls what logs, then what the caller wants to be told.
template <typename Log, typename... Args>
std::function<void(Args...)> first(Log log, std::function<void(Args...)> then) {
  return [log = std::move(log), then = std::move(then)](Args... args) {
    log(args...);
    if (then) then(args...);
  };
}

}  // namespace

SessionObservers SessionLog::before(SessionObservers observers) {
  if (!anything_is_logged()) return observers;
  const auto log = std::make_shared<SessionLog>();
  observers.frame =
      first([log](const FrameResult& frame) { log->frame(frame); }, std::move(observers.frame));
  observers.left_out =
      first([log](const LeftOut& input) { log->left_out(input); }, std::move(observers.left_out));
  observers.keyframe = first([log](const KeyframeResult& one) { log->keyframe(one); },
                             std::move(observers.keyframe));
  observers.loop =
      first([log](const LoopRecord& loop) { log->loop(loop); }, std::move(observers.loop));
  observers.map = first([log](const std::shared_ptr<const MapSnapshot>& map,
                              MapChange change) { log->map(*map, change); },
                        std::move(observers.map));
  observers.failure = first([log](const SessionFailure& failure) { log->failure(failure); },
                            std::move(observers.failure));
  return observers;
}

void SessionLog::frame(const FrameResult& frame) {
  Seen& seen = seen_[frame.camera];
  log_of(LogRoom::kTracking)
      .debug("{} {:.3f} s: {} by {}, {}", to_string(frame.camera), to_seconds(frame.time),
             to_string(frame.state), to_string(frame.tracked.source), counts_of(frame));
  tell_causes(frame, seen);
  tell_state(frame, seen);
  if (frame.mapping_behind != seen.mapping_behind) {
    log_of(LogRoom::kMapping)
        .info("{:.3f} s: {}", to_seconds(frame.time),
              frame.mapping_behind ? "mapping is behind: no keyframes are taken"
                                   : "mapping keeps up again");
  }
  seen.mapping_behind = frame.mapping_behind;
}

void SessionLog::tell_state(const FrameResult& frame, Seen& seen) {
  if (seen.any && frame.state == seen.state) return;
  const bool lost = frame.state == TrackingState::kLost;
  const std::string why = words_of(frame.causes);
  log_of(LogRoom::kTracking)
      .log(lost ? spdlog::level::warn : spdlog::level::info,
           "{} {:.3f} s, frame {}: {} -> {}; {}{}", to_string(frame.camera), to_seconds(frame.time),
           frame.index, seen.any ? to_string(seen.state) : "begin", to_string(frame.state),
           counts_of(frame), why.empty() ? "" : "; " + why);
  seen.state = frame.state;
  seen.any = true;
}

void SessionLog::tell_causes(const FrameResult& frame, Seen& seen) {
  std::string names = names_of(frame.causes);
  if (names == seen.causes) return;
  const std::string words = words_of(frame.causes);
  log_of(LogRoom::kInput)
      .log(words.empty() ? spdlog::level::info : spdlog::level::warn, "{} {:.3f} s: {}",
           to_string(frame.camera), to_seconds(frame.time), words.empty() ? "all well" : words);
  seen.causes = std::move(names);
}

// One that is left out is news, the thousandth is not.
void SessionLog::left_out(const LeftOut& input) {
  const std::size_t count = ++left_out_[input.reason];
  log_of(LogRoom::kInput)
      .log(is_power_of_two(count) ? spdlog::level::warn : spdlog::level::debug,
           "{} {:.3f} s is left out: {} ({} of this kind)", to_string(input.camera),
           to_seconds(input.time), input.reason, count);
}

void SessionLog::keyframe(const KeyframeResult& keyframe) {
  log_of(LogRoom::kMapping)
      .debug("keyframe {} of the {}, frame {}", keyframe.id.value, to_string(keyframe.camera),
             keyframe.index);
}

void SessionLog::loop(const LoopRecord& loop) {
  const LoopVerification& found = loop.verification;
  log_of(LogRoom::kLoops)
      .info(
          "keyframe {} at {:.3f} s looks like {} at {:.3f} s: {}; {} matches, {} inliers, {} "
          "landmarks found ({:.0f} % of those in view), {} neighbours confirm; moved by {:.3f} "
          "m, {:.2f} deg",
          loop.keyframe.value, loop.time, loop.match.value, loop.match_time, loop.outcome,
          found.matches, found.inliers, found.final_matches, 100 * found.found_share,
          found.confirmations, loop.translation, loop.rotation * 57.29577951308232);
}

void SessionLog::map(const MapSnapshot& map, MapChange change) {
  const auto level = change == MapChange::kKeyframe ? spdlog::level::debug : spdlog::level::info;
  log_of(LogRoom::kMapping)
      .log(level, "map: {}; {} keyframes, {} landmarks", to_string(change), map.keyframe_count(),
           map.landmark_count());
}

void SessionLog::failure(const SessionFailure& failure) {
  log_of(LogRoom::kSession)
      .log(failure.internal ? spdlog::level::critical : spdlog::level::err, "{}", failure.text);
}

}  // namespace hybrid_slam
