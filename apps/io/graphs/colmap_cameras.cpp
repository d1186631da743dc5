#include "apps/io/graphs/colmap_cameras.h"

#include <ceres/manifold.h>
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <set>

#include "apps/io/graphs/model_reprojection.h"
#include "cameras/field_of_view.h"
#include "cameras/radial_fisheye.h"
#include "cameras/rational.h"
#include "cameras/thin_prism_fisheye.h"

namespace hybrid_slam {

namespace {

using Kind = ColmapCameraPlace::Kind;

// Both programs have the focal lengths first, then the principal point, then the distortion.
std::size_t focal_lengths(const ColmapCameraKind& kind) {
  switch (kind.model) {
    case ColmapCameraModel::kSimplePinhole:
    case ColmapCameraModel::kSimpleRadial:
    case ColmapCameraModel::kRadial:
    case ColmapCameraModel::kSimpleRadialFisheye:
    case ColmapCameraModel::kRadialFisheye:
      return 1;
    default:
      return 2;
  }
}

// All but the principal point.
std::uint32_t refined_params(const ColmapCameraKind& kind) {
  const std::uint32_t all = (1U << kind.params) - 1;
  return all & ~(0b11U << focal_lengths(kind));
}

// A simpler model's missing coefficients are zero.
template <typename Params>
void copy_params(const ColmapCamera& camera, Params& params) {
  std::copy(camera.params.begin(), camera.params.end(), params.begin());
  const std::size_t principal = focal_lengths(camera.kind);
  params[principal] -= kColmapFirstPixel;
  params[principal + 1] -= kColmapFirstPixel;
}

template <ProjectionModel M>
ColmapCameraPlace add_camera(const ColmapCamera& camera, FactorGraph& graph) {
  Calibrated<M> result{{}, static_cast<int>(camera.width), static_cast<int>(camera.height)};
  copy_params(camera, result.params);
  graph.cameras.push_back({result, refined_params(camera.kind)});
  return {Kind::kCamera, static_cast<std::uint32_t>(graph.cameras.size()) - 1};
}

// What does not vary (the principal point, coefficients that a simpler model lacks) is held by the
// block's manifold.
template <ProjectionModel M>
ColmapCameraPlace add_block(const ColmapCamera& camera, FactorGraph& graph) {
  std::array<double, M::kParamCount> params{};
  copy_params(camera, params);
  const std::uint32_t refined = refined_params(camera.kind);
  std::vector<int> held;
  for (int i = 0; i < M::kParamCount; ++i) {
    if ((refined >> i & 1U) == 0) held.push_back(i);
  }
  GraphBlock block;
  block.values = Eigen::Map<const Eigen::VectorXd>(params.data(), M::kParamCount);
  block.manifold = std::make_shared<ceres::SubsetManifold>(M::kParamCount, held);
  block.shared = true;
  graph.blocks.push_back(std::move(block));
  return {Kind::kBlock, static_cast<std::uint32_t>(graph.blocks.size()) - 1};
}

ColmapCameraPlace add(const ColmapCamera& camera, FactorGraph& graph) {
  switch (camera.kind.model) {
    case ColmapCameraModel::kSimplePinhole:
    case ColmapCameraModel::kSimpleRadial:
    case ColmapCameraModel::kRadial:
      return add_camera<Radial>(camera, graph);
    case ColmapCameraModel::kPinhole:
      return add_camera<Pinhole>(camera, graph);
    case ColmapCameraModel::kOpencvFisheye:
      return add_camera<KannalaBrandt>(camera, graph);
    case ColmapCameraModel::kOpencv:
    case ColmapCameraModel::kFullOpencv:
      return add_block<Rational>(camera, graph);
    case ColmapCameraModel::kFov:
      return add_block<FieldOfView>(camera, graph);
    case ColmapCameraModel::kSimpleRadialFisheye:
    case ColmapCameraModel::kRadialFisheye:
      return add_block<RadialFisheye>(camera, graph);
    case ColmapCameraModel::kThinPrismFisheye:
      return add_block<ThinPrismFisheye>(camera, graph);
    case ColmapCameraModel::kRadTanThinPrism:
      return {};
  }
  throw std::logic_error("no such COLMAP camera");
}

std::shared_ptr<const ceres::CostFunction> reprojection(const ColmapCamera& camera,
                                                        const Eigen::Vector2d& pixel) {
  switch (camera.kind.model) {
    case ColmapCameraModel::kOpencv:
    case ColmapCameraModel::kFullOpencv:
      return std::make_shared<ModelReprojection<Rational>>(pixel);
    case ColmapCameraModel::kFov:
      return std::make_shared<ModelReprojection<FieldOfView>>(pixel);
    case ColmapCameraModel::kSimpleRadialFisheye:
    case ColmapCameraModel::kRadialFisheye:
      return std::make_shared<ModelReprojection<RadialFisheye>>(pixel);
    case ColmapCameraModel::kThinPrismFisheye:
      return std::make_shared<ModelReprojection<ThinPrismFisheye>>(pixel);
    default:
      throw std::logic_error("this COLMAP camera is no block");
  }
}

}  // namespace

std::vector<ColmapCameraPlace> add_colmap_cameras(const ColmapModel& model, FactorGraph& graph) {
  std::set<std::uint32_t> used;
  for (const ColmapImage& image : model.images) used.insert(image.camera);
  std::vector<ColmapCameraPlace> places;
  for (const ColmapCamera& camera : model.cameras) {
    for (std::size_t i = 0; i < focal_lengths(camera.kind); ++i) {
      if (!(camera.params[i] > 0)) {
        throw model.error("cameras", camera.place, "the focal length must be positive");
      }
    }
    places.push_back(add(camera, graph));
    if (places.back().kind == Kind::kNone && used.contains(camera.id)) {
      throw model.error(
          "cameras", camera.place,
          fmt::format("camera model {} is not supported where an image uses it", camera.kind.name));
    }
  }
  return places;
}

GraphFactor block_observation(const ColmapCamera& camera, std::uint32_t block, std::uint32_t frame,
                              std::uint32_t point, const Eigen::Vector2d& pixel) {
  GraphFactor factor;
  factor.function = reprojection(camera, pixel.array() - kColmapFirstPixel);
  factor.variables = {pose_variable(frame), point_variable(point), block_variable(block)};
  return factor;
}

void take_colmap_camera(const FactorGraph& graph, const ColmapCameraPlace& place,
                        ColmapCamera& camera) {
  if (place.kind == Kind::kNone) return;
  const auto take = [&](const double* params) {
    std::copy_n(params, camera.params.size(), camera.params.begin());
  };
  if (place.kind == Kind::kBlock) {
    take(graph.blocks[place.index].values.data());
  } else {
    std::visit([&](const auto& c) { take(c.params.data()); }, graph.cameras[place.index].camera);
  }
  const std::size_t principal = focal_lengths(camera.kind);
  camera.params[principal] += kColmapFirstPixel;
  camera.params[principal + 1] += kColmapFirstPixel;
}

}  // namespace hybrid_slam
