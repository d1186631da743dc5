#include "apps/report/frame_data.h"

#include <cstdint>
#include <string>
#include <utility>

#include "apps/report/page_arrays.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

}  // namespace

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
  std::vector<float> features, matches, inliers, odometer, sigma, turn, cpu, error, component;
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
                                        {&error, frame.error},
                                        {&component, frame.component}}) {
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
          {"cpu_ms", page_array(cpu)},
          {"error_m", page_array(error)},
          {"component", page_array(component)},
          {"causes", causes}};
}

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
