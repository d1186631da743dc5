#include "apps/report/map_data.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <variant>

#include "apps/report/page_arrays.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

// Position covariances of the frames that became keyframes, in the world, by camera and time.
std::map<std::pair<bool, long long>, Eigen::Matrix3d> covariances(
    const std::vector<KeyframeFigures>& keyframes, const RunStory& story) {
  std::map<std::uint32_t, const Rigid3d*> poses;
  for (const KeyframeFigures& keyframe : keyframes) {
    poses[keyframe.id.value] = &keyframe.world_from_cam;
  }
  std::map<std::pair<bool, long long>, Eigen::Matrix3d> found;
  for (const RunFrame& frame : story.frames) {
    if (!std::isfinite(frame.covariance[0])) continue;
    const auto& c = frame.covariance;
    Eigen::Matrix3d covariance;
    covariance << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
    if (frame.covariance_base) {
      const auto base = poses.find(frame.covariance_base->value);
      if (base == poses.end()) continue;
      const Eigen::Matrix3d turn = base->second->rotation().toRotationMatrix();
      covariance = turn * covariance * turn.transpose();
    }
    found[{frame.stereo, std::llround(1e6 * frame.time)}] = covariance;
  }
  return found;
}

}  // namespace

Json keyframes_json(const std::vector<KeyframeFigures>& keyframes, const RunStory& story) {
  const auto known = covariances(keyframes, story);
  std::vector<double> times;
  std::vector<std::uint32_t> ids, components, landmarks;
  std::vector<std::uint8_t> camera;
  std::vector<float> distance, resolution, rms, covariance;
  PoseArrays poses;
  for (const std::size_t i : evenly(keyframes.size(), kPageKeyframes)) {
    const KeyframeFigures& keyframe = keyframes[i];
    ids.push_back(keyframe.id.value);
    times.push_back(keyframe.time);
    camera.push_back(keyframe.stereo ? 0 : 1);
    components.push_back(keyframe.component.value);
    landmarks.push_back(static_cast<std::uint32_t>(keyframe.seen.size()));
    distance.push_back(static_cast<float>(keyframe.distance));
    resolution.push_back(static_cast<float>(keyframe.resolution));
    rms.push_back(static_cast<float>(keyframe.rms_sigmas));
    poses.add(keyframe.world_from_cam);
    const auto found = known.find({keyframe.stereo, std::llround(1e6 * keyframe.time)});
    for (const auto& [row, column] : {std::pair{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}}) {
      covariance.push_back(
          static_cast<float>(found == known.end() ? kUnknown : found->second(row, column)));
    }
  }
  return {{"count", ids.size()},
          {"of", keyframes.size()},
          {"id", page_array(ids)},
          {"time", page_array(times)},
          {"camera", page_array(camera)},
          {"component", page_array(components)},
          {"landmarks", page_array(landmarks)},
          {"distance_m", page_array(distance)},
          {"resolution_mm_per_px", page_array(resolution)},
          {"rms_sigmas", page_array(rms)},
          {"position", page_array(poses.positions)},
          {"rotation", page_array(poses.rotations)},
          {"covariance", page_array(covariance)}};
}

Json landmarks_json(const std::vector<LandmarkFigures>& landmarks, std::size_t limit) {
  double first = std::numeric_limits<double>::infinity(), last = -first;
  for (const LandmarkFigures& landmark : landmarks) {
    first = std::min(first, landmark.born);
    last = std::max(last, landmark.born);
  }
  std::vector<float> positions;
  std::vector<std::uint8_t> camera, views;
  std::vector<std::uint16_t> born, sigma;
  for (const std::size_t i : evenly(landmarks.size(), std::min(limit, kPageLandmarks))) {
    const LandmarkFigures& landmark = landmarks[i];
    for (int k = 0; k < 3; ++k) positions.push_back(static_cast<float>(landmark.point[k]));
    camera.push_back(landmark.stereo ? 0 : 1);
    views.push_back(static_cast<std::uint8_t>(std::min<std::size_t>(landmark.views, 255)));
    const double share = last > first ? (landmark.born - first) / (last - first) : 0;
    born.push_back(static_cast<std::uint16_t>(std::lround(65535 * share)));
    sigma.push_back(static_cast<std::uint16_t>(std::min(65535.0, 2e4 * landmark.sigma)));
  }
  return {{"count", camera.size()},
          {"of", landmarks.size()},
          {"born_from", camera.empty() ? Json() : Json(first)},
          {"born_to", camera.empty() ? Json() : Json(last)},
          {"sigma_unit_mm", 0.05},
          {"position", page_array(positions)},
          {"camera", page_array(camera)},
          {"views", page_array(views)},
          {"born", page_array(born)},
          {"sigma", page_array(sigma)}};
}

Json coverage_grid_json(const Coverage& coverage) {
  if (coverage.empty()) return Json();
  Json axes = Json::array();
  for (int row = 0; row < 3; ++row) {
    axes.push_back({coverage.axes(row, 0), coverage.axes(row, 1), coverage.axes(row, 2)});
  }
  return {{"axes", axes},
          {"cell_m", coverage.cell},
          {"corner_m", {coverage.corner.x(), coverage.corner.y()}},
          {"height_m", coverage.height},
          {"columns", coverage.columns},
          {"rows", coverage.rows},
          {"stereo_views", page_array(coverage.stereo_views)},
          {"fisheye_views", page_array(coverage.fisheye_views)},
          {"resolution_mm_per_px", page_array(coverage.resolution)},
          {"sigma_mm", page_array(coverage.sigma)}};
}

Json residual_grids_json(const MapFigures& figures) {
  Json grids = Json::array();
  for (const CameraResiduals& camera : figures.cameras) {
    std::vector<std::uint32_t> counts;
    std::vector<float> values;  // mean u, mean v, rms [px]
    for (const ResidualCell& cell : camera.cells) {
      counts.push_back(static_cast<std::uint32_t>(cell.count));
      for (const double value : {cell.mean_u, cell.mean_v, cell.rms}) {
        values.push_back(static_cast<float>(value));
      }
    }
    grids.push_back({{"camera", camera.stereo ? "stereo" : "fisheye"},
                     {"width", camera.width},
                     {"height", camera.height},
                     {"columns", CameraResiduals::kColumns},
                     {"rows", camera.rows},
                     {"count", page_array(counts)},
                     {"values", page_array(values)}});
  }
  return grids;
}

Json cameras_json(const std::vector<Camera>& cameras) {
  Json list = Json::array();
  for (const Camera& camera : cameras) {
    Json entry = {{"model", std::string(model_name(camera))},
                  {"width", image_width(camera)},
                  {"height", image_height(camera)}};
    std::visit([&](const auto& calibrated) { entry["parameters"] = calibrated.params; }, camera);
    list.push_back(entry);
  }
  return list;
}

}  // namespace hybrid_slam
