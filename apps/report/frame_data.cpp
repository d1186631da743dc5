#include "apps/report/frame_data.h"

#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <string>
#include <utility>

#include "apps/io/report.h"
#include "apps/io/trajectory.h"
#include "apps/report/page_arrays.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

Json or_null(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json losses_json(const RunStory& story) {
  Json list = Json::array();
  for (const LostStretch& loss : story.losses) {
    const RunFrame& first = story.frames[loss.first];
    list.push_back({{"camera", first.stereo ? "stereo" : "fisheye"},
                    {"from", first.time},
                    {"to", story.frames[loss.last].time},
                    {"frames", loss.frames},
                    {"cause", loss.cause}});
  }
  return list;
}

std::vector<double> known_of(const std::vector<RunFrame>& frames, double RunFrame::*figure) {
  std::vector<double> values;
  for (const RunFrame& frame : frames) {
    if (std::isfinite(frame.*figure)) values.push_back(frame.*figure);
  }
  return values;
}

// Null without values.
Json times_json(const std::vector<double>& ms) {
  if (ms.empty()) return Json();
  const double sum = std::accumulate(ms.begin(), ms.end(), 0.0);
  return {{"mean", sum / static_cast<double>(ms.size())},
          {"median", quantile(ms, 0.5)},
          {"p95", quantile(ms, 0.95)},
          {"max", quantile(ms, 1)}};
}

Json errors_by_state(const RunStory& story) {
  std::map<std::pair<bool, std::string>, std::vector<double>> errors;  // stereo first
  for (const RunFrame& frame : story.frames) {
    if (std::isfinite(frame.error)) errors[{!frame.stereo, frame.state}].push_back(frame.error);
  }
  Json list = Json::array();
  for (const auto& [of, values] : errors) {
    list.push_back({{"camera", of.first ? "fisheye" : "stereo"},
                    {"state", of.second},
                    {"position_m", to_json(error_statistics(values))}});
  }
  return list;
}

}  // namespace

Json story_json(const RunStory& story) {
  return {{"span_s", story.span},
          {"period_s", or_null(story.period)},
          {"losses", losses_json(story)},
          {"cpu_ms", times_json(known_of(story.frames, &RunFrame::cpu_ms))},
          {"behind_ms", times_json(known_of(story.frames, &RunFrame::behind_ms))},
          {"error_by_state", errors_by_state(story)}};
}

std::vector<std::size_t> frames_to_show(const std::vector<RunFrame>& frames) {
  const std::size_t step = (frames.size() + kPageFrames - 1) / kPageFrames;
  std::vector<std::size_t> shown;
  const RunFrame* last[2] = {nullptr, nullptr};  // by camera
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const RunFrame*& before = last[frames[i].stereo ? 0 : 1];
    const bool changed = before == nullptr || before->state != frames[i].state;
    if (step <= 1 || i % step == 0 || changed) shown.push_back(i);
    before = &frames[i];
  }
  return shown;
}

Json frames_json(const RunStory& story) {
  NameNumbers states, sources, predictions;
  std::vector<double> times;
  std::vector<std::uint8_t> camera, state, source, prediction;
  std::vector<float> features, matches, inliers, odometer, sigma, turn, cpu, behind, error,
      component, rows;
  PoseArrays poses;
  Json causes = Json::object();
  const std::vector<std::size_t> shown = frames_to_show(story.frames);
  for (const std::size_t i : shown) {
    const RunFrame& frame = story.frames[i];
    if (!frame.causes.empty()) causes[std::to_string(times.size())] = frame.causes;
    times.push_back(frame.time);
    camera.push_back(frame.stereo ? 0 : 1);
    state.push_back(states[frame.state]);
    source.push_back(sources[frame.source]);
    prediction.push_back(predictions[frame.prediction]);
    poses.add(frame.world_from_cam);
    for (const auto& [column, value] : {std::pair{&features, frame.features},
                                        {&matches, frame.stereo_matches},
                                        {&inliers, frame.inliers},
                                        {&odometer, frame.odometer},
                                        {&sigma, frame.sigma_position},
                                        {&turn, frame.sigma_rotation},
                                        {&cpu, frame.cpu_ms},
                                        {&behind, frame.behind_ms},
                                        {&error, frame.error},
                                        {&component, frame.component},
                                        {&rows, frame.row_error}}) {
      column->push_back(static_cast<float>(value));
    }
  }
  return {{"count", times.size()},
          {"of", story.frames.size()},
          {"states", states.list()},
          {"sources", sources.list()},
          {"predictions", predictions.list()},
          {"time", page_array(times)},
          {"camera", page_array(camera)},
          {"state", page_array(state)},
          {"source", page_array(source)},
          {"prediction", page_array(prediction)},
          {"position", page_array(poses.positions)},
          {"rotation", page_array(poses.rotations)},
          {"features", page_array(features)},
          {"stereo_matches", page_array(matches)},
          {"inliers", page_array(inliers)},
          {"odometer_inliers", page_array(odometer)},
          {"sigma_position", page_array(sigma)},
          {"sigma_rotation_deg", page_array(turn)},
          {"row_error_px", page_array(rows)},
          {"cpu_ms", page_array(cpu)},
          {"behind_ms", page_array(behind)},
          {"error_m", page_array(error)},
          {"component", page_array(component)},
          {"causes", causes}};
}

Json truth_json(const ResultTable& errors) {
  std::vector<double> times;
  std::vector<float> positions;
  std::vector<std::uint8_t> camera;
  for (const std::size_t i : evenly(errors.size(), kPageFrames)) {
    times.push_back(errors.number(i, "time"));
    camera.push_back(errors.text(i, "camera") == "fisheye" ? 1 : 0);
    for (const char* column : {"true_x", "true_y", "true_z"}) {
      positions.push_back(static_cast<float>(errors.number(i, column)));
    }
  }
  return {{"count", times.size()},
          {"time", page_array(times)},
          {"camera", page_array(camera)},
          {"position", page_array(positions)}};
}

}  // namespace hybrid_slam
