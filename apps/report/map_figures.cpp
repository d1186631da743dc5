#include "apps/report/map_figures.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <unordered_map>

#include "cameras/files/output_file.h"
#include "factors/camera_reprojection.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

// Sums over the observations of one camera.
struct CameraSums {
  double px = 0;  // of squares
  double right_px = 0;
  std::size_t rights = 0;
  double sigmas = 0;
  std::size_t coordinates = 0;
  std::vector<double> assumed;
  std::vector<double> lengths;  // of residuals, per coordinate, in standard deviations
};

CameraResiduals empty_residuals(const MapSnapshot& map, CameraId id) {
  const Camera& camera = map.camera(id);
  CameraResiduals result;
  result.camera = id;
  result.stereo = baseline(camera) > 0;
  result.width = image_width(camera);
  result.height = image_height(camera);
  const double aspect = static_cast<double>(result.height) / std::max(1, result.width);
  result.rows = std::max(1, static_cast<int>(std::lround(CameraResiduals::kColumns * aspect)));
  result.cells.resize(static_cast<std::size_t>(CameraResiduals::kColumns * result.rows));
  return result;
}

ResidualCell& cell_at(CameraResiduals& residuals, const Keypoint& keypoint) {
  const auto place = [](double x, int size, int cells) {
    return std::clamp(static_cast<int>((x + 0.5) / std::max(1, size) * cells), 0, cells - 1);
  };
  const int column = place(keypoint.x, residuals.width, CameraResiduals::kColumns);
  const int row = place(keypoint.y, residuals.height, residuals.rows);
  return residuals.cells[static_cast<std::size_t>(row * CameraResiduals::kColumns + column)];
}

// Gathers residuals by camera and keyframe, and what they tell of the landmarks.
class Gatherer {
 public:
  explicit Gatherer(const MapSnapshot& map) : map_(map) {
    for (std::size_t i = 0; i < map.camera_count(); ++i) {
      figures_.cameras.push_back(empty_residuals(map, CameraId(static_cast<std::uint32_t>(i))));
    }
    sums_.resize(figures_.cameras.size());
  }

  MapFigures gather() {
    for (const LandmarkId id : map_.landmark_ids()) {
      const Landmark& landmark = map_.at(id);
      const Keyframe& reference = map_.at(landmark.reference);
      place_[id.value] = static_cast<std::uint32_t>(figures_.landmarks.size());
      figures_.landmarks.push_back({landmark.point_in_world, baseline(map_.camera(reference)) > 0,
                                    landmark.observations.size(), reference.observations->time, 0});
    }
    information_.assign(figures_.landmarks.size(), Eigen::Matrix3d::Zero());
    for (const KeyframeId id : map_.keyframe_ids()) add(map_.at(id));
    for (std::size_t i = 0; i < information_.size(); ++i) {
      const Eigen::LDLT<Eigen::Matrix3d> solver(information_[i]);
      const double trace = solver.solve(Eigen::Matrix3d::Identity()).trace();
      const bool known = solver.info() == Eigen::Success && solver.isPositive() && trace > 0;
      figures_.landmarks[i].sigma =
          known ? std::sqrt(trace) : std::numeric_limits<double>::infinity();
    }
    for (std::size_t i = 0; i < sums_.size(); ++i) finish(figures_.cameras[i], sums_[i]);
    return std::move(figures_);
  }

 private:
  void add(const Keyframe& keyframe) {
    const Camera& camera = map_.camera(keyframe);
    KeyframeFigures found{keyframe.id,
                          baseline(camera) > 0,
                          keyframe.observations->time,
                          keyframe.component,
                          inverse(keyframe.cam_from_world),
                          {}};
    std::vector<double> distances;
    double squares = 0;
    std::size_t coordinates = 0;
    for (std::size_t i = 0; i < keyframe.landmarks.size(); ++i) {
      if (!keyframe.landmarks[i].valid()) continue;
      const std::uint32_t at = place_.at(keyframe.landmarks[i].value);
      found.seen.push_back(at);
      const Eigen::Vector3d point = keyframe.cam_from_world * figures_.landmarks[at].point;
      distances.push_back(found.stereo ? point.z() : point.norm());
      squares += add_observation(keyframe, camera, i, at, coordinates);
    }
    found.distance = quantile(distances, 0.5);
    found.resolution = 1e3 * found.distance / focal_length(camera);
    if (coordinates > 0) found.rms_sigmas = std::sqrt(squares / static_cast<double>(coordinates));
    figures_.keyframes.push_back(std::move(found));
  }

  // The square of the whitened residual.
  double add_observation(const Keyframe& keyframe, const Camera& camera, std::size_t index,
                         std::uint32_t landmark, std::size_t& coordinates) {
    const FrameObservations& seen = *keyframe.observations;
    const Keypoint& keypoint = seen.features.keypoints[index];
    CameraResiduals& residuals = figures_.cameras[seen.camera.value];
    CameraSums& sums = sums_[seen.camera.value];
    const Eigen::Vector3d measurement(keypoint.x, keypoint.y,
                                      seen.has_right(index) ? seen.u_right[index] : kNoRightMatch);
    double residual[3];
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> d_point = Eigen::Matrix3d::Zero();
    if (!camera_reprojection_residual(camera, keyframe.cam_from_world.params.data(),
                                      figures_.landmarks[landmark].point.data(), measurement,
                                      keypoint.sigma, residual, nullptr, d_point.data())) {
      ++residuals.behind;
      return 0;
    }
    const int rows = reprojection_rows(camera, measurement);
    const auto j = d_point.topRows(rows);
    information_[landmark] += j.transpose() * j;
    const double square = Eigen::Map<Eigen::VectorXd>(residual, rows).squaredNorm();
    const double u = residual[0] * keypoint.sigma, v = residual[1] * keypoint.sigma;
    ++residuals.observations;
    sums.px += u * u + v * v;
    if (rows == 3) {
      sums.right_px += std::pow(residual[2] * keypoint.sigma, 2);
      ++sums.rights;
    }
    sums.sigmas += square;
    sums.coordinates += static_cast<std::size_t>(rows);
    sums.assumed.push_back(keypoint.sigma);
    sums.lengths.push_back(std::sqrt(square / rows));
    ResidualCell& cell = cell_at(residuals, keypoint);
    ++cell.count;
    cell.mean_u += u;
    cell.mean_v += v;
    cell.rms += u * u + v * v;
    coordinates += static_cast<std::size_t>(rows);
    return square;
  }

  static void finish(CameraResiduals& residuals, const CameraSums& sums) {
    if (residuals.observations == 0) return;
    const auto count = static_cast<double>(residuals.observations);
    residuals.rms_px = std::sqrt(sums.px / (2 * count));
    if (sums.rights > 0) {
      residuals.rms_right_px = std::sqrt(sums.right_px / static_cast<double>(sums.rights));
    }
    residuals.assumed_px = quantile(sums.assumed, 0.5);
    residuals.rms_sigmas = std::sqrt(sums.sigmas / static_cast<double>(sums.coordinates));
    residuals.median_sigmas = quantile(sums.lengths, 0.5);
    for (ResidualCell& cell : residuals.cells) {
      if (cell.count == 0) continue;
      const auto in_cell = static_cast<double>(cell.count);
      cell.mean_u /= in_cell;
      cell.mean_v /= in_cell;
      cell.rms = std::sqrt(cell.rms / (2 * in_cell));
    }
  }

  const MapSnapshot& map_;
  MapFigures figures_;
  std::vector<CameraSums> sums_;
  std::vector<Eigen::Matrix3d> information_;                // of the landmarks
  std::unordered_map<std::uint32_t, std::uint32_t> place_;  // of a landmark's id
};

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(); }

std::string field(double value) {
  return std::isfinite(value) ? fmt::format(",{:.6g}", value) : std::string(",");
}

const char* kind_of(bool stereo) { return stereo ? "stereo" : "fisheye"; }

}  // namespace

MapFigures map_figures(const MapSnapshot& map) { return Gatherer(map).gather(); }

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return kUnknown;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

Json residuals_json(const MapFigures& figures) {
  Json json = Json::object();
  for (const CameraResiduals& camera : figures.cameras) {
    json[kind_of(camera.stereo)] = {{"observations", camera.observations},
                                    {"not_projectable", camera.behind},
                                    {"rms_px", number(camera.rms_px)},
                                    {"rms_right_px", number(camera.rms_right_px)},
                                    {"assumed_sigma_px", number(camera.assumed_px)},
                                    {"rms_sigmas", number(camera.rms_sigmas)},
                                    {"median_sigmas", number(camera.median_sigmas)}};
  }
  return json;
}

Json landmark_sigma_json(const MapFigures& figures) {
  std::vector<double> sigmas;
  for (const LandmarkFigures& landmark : figures.landmarks) sigmas.push_back(1e3 * landmark.sigma);
  return {{"median", number(quantile(sigmas, 0.5))}, {"p95", number(quantile(sigmas, 0.95))}};
}

void write_keyframes(const std::filesystem::path& path, const MapFigures& figures) {
  std::string text =
      "keyframe,camera,time,component,tx,ty,tz,qx,qy,qz,qw,landmarks,distance_m,"
      "resolution_mm_per_px,rms_sigmas\n";
  for (const KeyframeFigures& keyframe : figures.keyframes) {
    text += fmt::format("{},{},{:.9f},{}", keyframe.id.value, kind_of(keyframe.stereo),
                        keyframe.time, keyframe.component.value);
    for (const double value : {keyframe.world_from_cam.params[4], keyframe.world_from_cam.params[5],
                               keyframe.world_from_cam.params[6], keyframe.world_from_cam.params[0],
                               keyframe.world_from_cam.params[1], keyframe.world_from_cam.params[2],
                               keyframe.world_from_cam.params[3]}) {
      text += fmt::format(",{:.9f}", value);
    }
    text += fmt::format(",{}", keyframe.seen.size()) + field(keyframe.distance) +
            field(keyframe.resolution) + field(keyframe.rms_sigmas) + "\n";
  }
  write_file(path, text);
}

void write_residuals(const std::filesystem::path& path, const MapFigures& figures) {
  std::string text = "camera,column,row,u_px,v_px,observations,mean_u_px,mean_v_px,rms_px\n";
  for (const CameraResiduals& camera : figures.cameras) {
    for (std::size_t i = 0; i < camera.cells.size(); ++i) {
      const ResidualCell& cell = camera.cells[i];
      const auto column = static_cast<int>(i) % CameraResiduals::kColumns;
      const auto row = static_cast<int>(i) / CameraResiduals::kColumns;
      text +=
          fmt::format("{},{},{},{:.1f},{:.1f},{},{:.5f},{:.5f},{:.5f}\n", kind_of(camera.stereo),
                      column, row, (column + 0.5) * camera.width / CameraResiduals::kColumns - 0.5,
                      (row + 0.5) * camera.height / camera.rows - 0.5, cell.count, cell.mean_u,
                      cell.mean_v, cell.rms);
    }
  }
  write_file(path, text);
}

}  // namespace hybrid_slam
