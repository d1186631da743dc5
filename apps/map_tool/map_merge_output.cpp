#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/map_tool/map_merge.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

std::size_t keyframes_of(const MergeSummary& summary) {
  std::size_t keyframes = 0;
  for (const MergedInput& input : summary.inputs) keyframes += input.keyframes;
  return keyframes;
}

double total(const MergeSummary& summary, double MergeStageTime::*time) {
  return summary.find.*time + summary.close.*time + summary.fuse.*time + summary.adjust.*time;
}

Json stage_json(const MergeStageTime& stage) {
  return {{"wall_s", stage.wall_s}, {"cpu_s", stage.cpu_s}};
}

}  // namespace

std::string to_text(const MergeSummary& summary, std::span<const std::string> names) {
  std::string text;
  for (std::size_t i = 0; i < summary.inputs.size(); ++i) {
    const MergedInput& input = summary.inputs[i];
    text += fmt::format("{}: {} keyframes from {} on, in component {}\n", names[i], input.keyframes,
                        input.first.value, input.component.value);
  }
  text += fmt::format("components  {}{}\n", summary.components,
                      summary.components == 1 ? "" : ": nothing joins them, they stay apart");
  text += fmt::format(
      "places      {} proposed between components, {} verified; {} joins; {} without a second one "
      "that agrees\n",
      summary.proposed, summary.verified, summary.joins, summary.unconfirmed);
  text += fmt::format("loops       {} closed, {} refused; {} landmarks fused\n", summary.closed,
                      summary.refused, summary.fused);
  const auto keyframes = static_cast<double>(keyframes_of(summary));
  text += fmt::format(
      "time        {:.2f} s ({:.2f} s of CPU: {:.1f} ms per keyframe): find {:.2f}, close {:.2f}, "
      "fuse {:.2f}, adjust {:.2f} s\n",
      total(summary, &MergeStageTime::wall_s), total(summary, &MergeStageTime::cpu_s),
      1e3 * total(summary, &MergeStageTime::cpu_s) / keyframes, summary.find.wall_s,
      summary.close.wall_s, summary.fuse.wall_s, summary.adjust.wall_s);
  return text;
}

Json to_json(const MergeSummary& summary, std::span<const std::string> names) {
  Json inputs = Json::array();
  for (std::size_t i = 0; i < summary.inputs.size(); ++i) {
    const MergedInput& input = summary.inputs[i];
    inputs.push_back({{"map", names[i]},
                      {"keyframes", input.keyframes},
                      {"first_keyframe", input.first.value},
                      {"component", input.component.value}});
  }
  const auto keyframes = static_cast<double>(keyframes_of(summary));
  return {{"inputs", inputs},
          {"components", summary.components},
          {"places_proposed", summary.proposed},
          {"places_verified", summary.verified},
          {"places_unconfirmed", summary.unconfirmed},
          {"joins", summary.joins},
          {"loops_closed", summary.closed},
          {"loops_refused", summary.refused},
          {"landmarks_fused", summary.fused},
          {"cpu_ms_per_keyframe", 1e3 * total(summary, &MergeStageTime::cpu_s) / keyframes},
          {"time",
           {{"find", stage_json(summary.find)},
            {"close", stage_json(summary.close)},
            {"fuse", stage_json(summary.fuse)},
            {"adjust", stage_json(summary.adjust)}}}};
}

}  // namespace hybrid_slam
