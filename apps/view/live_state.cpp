#include "apps/view/live_state.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>

#include "apps/report/frame_data.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kLoopsKept = 1000;

}  // namespace

void LiveState::add(LiveFrame frame) {
  frames_.push_back(std::move(frame));
  if (frames_.size() < 2 * kPageFrames) return;
  std::vector<RunFrame> lines;
  for (const LiveFrame& each : frames_) lines.push_back(each.line);
  std::vector<LiveFrame> kept;
  for (const std::size_t i : frames_to_show(lines)) kept.push_back(std::move(frames_[i]));
  // Where the state changes at every second frame, nothing could be left out.
  if (kept.size() > kPageFrames * 3 / 2) kept.erase(kept.begin(), kept.end() - kPageFrames);
  forgotten_ += frames_.size() - kept.size();
  frames_ = std::move(kept);
}

void LiveState::add(const LoopRecord& loop) {
  if (loops_.size() >= kLoopsKept) loops_.erase(loops_.begin());
  loops_.push_back(loop);
}

Json LiveState::json(const MapSnapshot* map, const LiveSteps& steps, std::size_t missed) const {
  const RunStory story = live_story(frames_, map);
  Json json = map != nullptr ? live_map_json(*map, story, steps) : Json::object();
  json["title"] = title_;
  json["frames"] = frames_json(story);
  json["frames"]["of"] = frames_.size() + forgotten_;
  json.update(story_json(story));
  json["loops"] = Json::array();
  for (const LoopRecord& loop : loops_) json["loops"].push_back(loop_json(loop));
  json["missed"] = missed;
  return json;
}

Json loop_json(const LoopRecord& loop) {
  constexpr double kDegreesPerRad = 180 / std::numbers::pi;
  return {{"outcome", loop.outcome},       {"time", loop.time},
          {"match_time", loop.match_time}, {"final_matches", loop.verification.final_matches},
          {"off_m", loop.translation},     {"off_deg", kDegreesPerRad * loop.rotation},
          {"joins", loop.joins ? 1 : 0}};
}

}  // namespace hybrid_slam
