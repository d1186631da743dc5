#include "frontend/calibration/residual_map.h"

#include <algorithm>
#include <cmath>

#include "factors/camera_reprojection.h"

namespace hybrid_slam {
namespace {

// The newest keyframes of a camera, oldest first.
std::vector<KeyframeId> newest_of(const MapSnapshot& map, CameraId camera, std::size_t most) {
  std::vector<KeyframeId> ids;
  for (const KeyframeId id : map.keyframe_ids()) {
    if (map.at(id).observations->camera == camera) ids.push_back(id);
  }
  if (ids.size() > most) ids.erase(ids.begin(), ids.end() - static_cast<std::ptrdiff_t>(most));
  return ids;
}

void add_residuals(const MapSnapshot& map, const Keyframe& keyframe, std::size_t half,
                   ResidualMap& result) {
  const FrameObservations& seen = *keyframe.observations;
  const Camera& camera = map.camera(keyframe);
  for (std::size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    if (!keyframe.landmarks[i].valid()) continue;
    const Landmark& landmark = map.at(keyframe.landmarks[i]);
    if (landmark.observations.size() < 2) continue;  // fits by itself
    const Keypoint& keypoint = seen.features.keypoints[i];
    const Eigen::Vector3d measurement(keypoint.x, keypoint.y,
                                      seen.has_right(i) ? seen.u_right[i] : kNoRightMatch);
    double residual[3];
    if (!camera_reprojection_residual(camera, keyframe.cam_from_world.params.data(),
                                      landmark.point_in_world.data(), measurement, 1, residual,
                                      nullptr, nullptr)) {
      continue;
    }
    auto& cell = result.halves[result.cells.of(keypoint.x, keypoint.y)];
    cell[0][half].add(residual[0]);
    cell[1][half].add(residual[1]);
    if (seen.has_right(i)) cell[2][half].add(residual[0] - residual[2]);
  }
}

struct Products {
  double sum = 0;
  double weight = 0;
};

// The product of a cell's two means, weighed by what both rest on.
Products product_of(const std::array<Moments, 2>& halves) {
  if (halves[0].count == 0 || halves[1].count == 0) return {};
  const double weight = 1 / (1 / halves[0].count + 1 / halves[1].count);
  return {weight * halves[0].mean() * halves[1].mean(), weight};
}

// By cell, over it and those around it.
std::vector<double> smoothed(const ImageCells& cells, const std::vector<Products>& products) {
  std::vector<double> result(cells.size());
  for (int row = 0; row < cells.rows; ++row) {
    for (int column = 0; column < ImageCells::kColumns; ++column) {
      Products sum;
      for (int r = std::max(0, row - 1); r <= std::min(cells.rows - 1, row + 1); ++r) {
        for (int c = std::max(0, column - 1); c <= std::min(ImageCells::kColumns - 1, column + 1);
             ++c) {
          const Products& one = products[static_cast<std::size_t>(r * ImageCells::kColumns + c)];
          sum.sum += one.sum;
          sum.weight += one.weight;
        }
      }
      result[static_cast<std::size_t>(row * ImageCells::kColumns + column)] =
          sum.weight > 0 ? std::max(0.0, sum.sum / sum.weight) : 0;
    }
  }
  return result;
}

double root_mean(const std::vector<Products>& products) {
  Products all;
  for (const Products& one : products) {
    all.sum += one.sum;
    all.weight += one.weight;
  }
  return all.weight > 0 ? std::sqrt(std::max(0.0, all.sum / all.weight)) : 0;
}

}  // namespace

ResidualMap residual_map(const MapSnapshot& map, CameraId camera, std::size_t most) {
  const Camera& model = map.camera(camera);
  ResidualMap result;
  result.camera = camera;
  result.cells = ImageCells(image_width(model), image_height(model));
  result.halves.resize(result.cells.size());
  const std::vector<KeyframeId> ids = newest_of(map, camera, most);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    add_residuals(map, map.at(ids[i]), 2 * i < ids.size() ? 0 : 1, result);
  }
  return result;
}

SystematicPart systematic_part(const ResidualMap& map) {
  std::vector<Products> image(map.cells.size()), disparity(map.cells.size());
  double sum = 0, squares = 0;
  for (std::size_t cell = 0; cell < map.cells.size(); ++cell) {
    for (std::size_t measured = 0; measured < kMeasured; ++measured) {
      const Products one = product_of(map.halves[cell][measured]);
      sum += one.sum;
      squares += one.sum * one.sum;
      Products& into = measured < 2 ? image[cell] : disparity[cell];
      into.sum += one.sum;
      into.weight += one.weight;
    }
  }
  SystematicPart part;
  part.image = smoothed(map.cells, image);
  part.disparity = smoothed(map.cells, disparity);
  part.image_rms = root_mean(image);
  part.disparity_rms = root_mean(disparity);
  part.significance = squares > 0 ? sum / std::sqrt(squares) : 0;
  return part;
}

}  // namespace hybrid_slam
