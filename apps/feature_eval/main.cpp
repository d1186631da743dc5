#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <nlohmann/json.hpp>

#include "apps/feature_eval/command_line.h"
#include "apps/feature_eval/evaluation.h"
#include "apps/feature_eval/study/study_files.h"
#include "apps/io/report.h"
#include "apps/program/program.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

// "total_ms" and "stages": medians over the runs.
Json times_json(const StageTimes& times) {
  Json json = {{"total_ms", 0}, {"stages", Json::object()}};
  for (const auto& [stage, durations] : times.stages()) {
    (stage == kTotal ? json["total_ms"] : json["stages"][stage]) = percentile(durations.kept(), 50);
  }
  return json;
}

// The same, as the mean over several things, each with such times.
Json mean_times(const Json& things) {
  Json mean = {{"total_ms", 0.0}, {"stages", Json::object()}};
  const auto count = static_cast<double>(things.size());
  const auto add = [&](Json& sum, const Json& time) {
    sum =
        sum.is_null() ? time.get<double>() / count : sum.get<double>() + time.get<double>() / count;
  };
  for (const Json& thing : things) {
    add(mean["total_ms"], thing["total_ms"]);
    for (const auto& [stage, time] : thing["stages"].items()) add(mean["stages"][stage], time);
  }
  return mean;
}

Json images_json(const Evaluation& evaluation) {
  Json images = Json::array();
  for (const ExtractionResult& result : evaluation.images) {
    Json image = {{"image", result.image},
                  {"width", result.width},
                  {"height", result.height},
                  {"keypoints", result.keypoints}};
    image.update(times_json(result.times));
    images.push_back(image);
  }
  return images;
}

Json pairs_json(const Evaluation& evaluation) {
  Json pairs = Json::array();
  for (const MatchResult& result : evaluation.pairs) {
    Json pair = {{"first", result.first}, {"second", result.second}, {"matches", result.matches}};
    pair.update(times_json(result.times));
    pairs.push_back(pair);
  }
  return pairs;
}

// Times at the top are those of what the command is about.
Json evaluation_json(const CommandLine& line, const Evaluation& evaluation) {
  const bool match = line.command == EvalCommand::kMatch;
  const Json images = images_json(evaluation), pairs = pairs_json(evaluation);
  Json json = {{"command", match ? "match" : "extract"},
               {"engine", to_string(line.engine)},
               {"upsample", line.sift.upsample},
               {"features", line.sift.max_features},
               {"threads", line.threads},
               {"repeat", line.repeat}};
  json.update(mean_times(match ? pairs : images));
  json["images"] = images;
  if (match) json["pairs"] = pairs;
  return json;
}

void print_times(const Json& times) {
  fmt::print("  {:.2f} ms:", times["total_ms"].get<double>());
  const char* separator = "";
  for (const auto& [stage, time] : times["stages"].items()) {
    fmt::print("{} {} {:.2f}", separator, stage, time.get<double>());
    separator = ",";
  }
  fmt::print("\n");
}

void print_results(const Json& json) {
  for (const Json& image : json["images"]) {
    fmt::print("{}: {}x{}, {} keypoints\n", image["image"].get<std::string>(),
               image["width"].get<int>(), image["height"].get<int>(),
               image["keypoints"].get<std::size_t>());
    print_times(image);
  }
  if (!json.contains("pairs")) return;
  for (const Json& pair : json["pairs"]) {
    fmt::print("{} - {}: {} matches\n", pair["first"].get<std::string>(),
               pair["second"].get<std::string>(), pair["matches"].get<std::size_t>());
    print_times(pair);
  }
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  using namespace hybrid_slam;
  return run_program("feature_eval", [&]() -> int {
    int exit_code = kExitOk;
    const auto line = parse_command_line(argc, argv, exit_code);
    if (!line) return exit_code;
    if (line->command == EvalCommand::kStudy) {
      const Study study = run_study(line->study);
      write_study(study, line->study);
      fmt::print("{}", study_text(study));
      return kExitOk;
    }
    const Json json = evaluation_json(*line, evaluate(*line));
    print_results(json);
    if (!line->json.empty()) write_json(line->json, json);
    return kExitOk;
  });
}
