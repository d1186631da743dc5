#include "apps/hybrid_slam/loop_outputs.h"

#include <fmt/format.h>

#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>

#include "cameras/files/output_file.h"

namespace hybrid_slam {

nlohmann::ordered_json to_json(const std::vector<LoopRecord>& loops) {
  int accepted = 0;
  int joined = 0;
  std::map<std::string, int> rejected;
  for (const LoopRecord& loop : loops) {
    ++(loop.outcome == kLoopAccepted ? accepted : rejected[loop.outcome]);
    if (loop.outcome == kLoopAccepted && loop.joins) ++joined;
  }
  return {{"proposed", loops.size()},
          {"accepted", accepted},
          {"joined_components", joined},
          {"rejected", rejected}};
}

void write_loops(const std::filesystem::path& path, const std::vector<LoopRecord>& loops) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  std::string text =
      "time,match_time,outcome,matches,inliers,final_matches,found_share,off_m,off_deg,joins\n";
  for (const LoopRecord& loop : loops) {
    const LoopVerification& seen = loop.verification;
    text +=
        fmt::format("{:.6f},{:.6f},{},{},{},{},{:.3f},{:.4f},{:.3f},{:d}\n", loop.time,
                    loop.match_time, loop.outcome, seen.matches, seen.inliers, seen.final_matches,
                    seen.found_share, loop.translation, kDegrees * loop.rotation, loop.joins);
  }
  write_file(path, text);
}

}  // namespace hybrid_slam
