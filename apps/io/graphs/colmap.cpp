#include "apps/io/graphs/colmap.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <unordered_map>

#include <ceres/cost_function.h>
#include "apps/io/graphs/colmap_cameras.h"
#include "apps/io/graphs/colmap_rigs.h"
#include "apps/io/graphs/graph_errors.h"

#include "cameras/files/output_file.h"

namespace hybrid_slam {

namespace {

namespace fs = std::filesystem;

template <typename Id>
using Index = std::unordered_map<Id, std::uint32_t>;

template <typename Id, typename T>
Index<Id> index_by_id(const ColmapModel& model, const std::vector<T>& items, std::string_view name,
                      std::string_view what) {
  Index<Id> index;
  for (const T& item : items) {
    if (!index.emplace(item.id, static_cast<std::uint32_t>(index.size())).second) {
      throw model.error(name, item.place, fmt::format("{} {} is there already", what, item.id));
    }
  }
  return index;
}

// The images say who sees what; a track must not contradict them.
void check_tracks(const ColmapModel& model, const Index<std::uint32_t>& images) {
  for (const ColmapPoint& point : model.points) {
    for (const ColmapTrackElement& element : point.track) {
      const auto image = images.find(element.image);
      if (image == images.end()) {
        throw model.error("points3D", point.place,
                          fmt::format("the track of point {} names image {}, which there is not",
                                      point.id, element.image));
      }
      const auto& seen = model.images[image->second].points;
      if (element.point >= seen.size() || seen[element.point].point != point.id) {
        throw model.error(
            "points3D", point.place,
            fmt::format("the track of point {} names point {} of image {}, which is not its",
                        point.id, element.point, element.image));
      }
    }
  }
}

void add_observations(const ColmapModel& model, const Index<std::uint32_t>& cameras,
                      const Index<std::uint64_t>& points,
                      const std::vector<ColmapCameraPlace>& places, FactorGraph& graph) {
  for (std::uint32_t i = 0; i < model.images.size(); ++i) {
    const ColmapImage& image = model.images[i];
    for (const ColmapPoint2d& seen : image.points) {
      if (seen.point == ColmapPoint2d::kNoPoint) continue;
      const auto point = points.find(seen.point);
      if (point == points.end()) {
        throw model.error(
            "images", image.place,
            fmt::format("image {} names point {}, which there is not", image.id, seen.point));
      }
      const std::uint32_t camera = cameras.at(image.camera);
      if (places[camera].kind == ColmapCameraPlace::Kind::kBlock) {
        graph.factors.push_back(block_observation(model.cameras[camera], places[camera].index, i,
                                                  point->second, seen.pixel));
        continue;
      }
      GraphObservation observation;
      observation.frame = i;
      observation.point = point->second;
      observation.measurement.head<2>() = seen.pixel.array() - kColmapFirstPixel;
      graph.observations.push_back(observation);
    }
  }
}

// The images of a rig's frame stay where they are on it. An edge holds them there, so stiff that
// what the observations bend it by is lost among their noise: 1e-5 rad are 0.01 px at a focal
// length of 1000 px; when the model is written, the rest of it goes.
void add_rigs(const ColmapModel& model, FactorGraph& graph) {
  constexpr double kTurn = 1e-6;      // sigma [rad]
  constexpr double kShift = 1e-6;     // sigma by the distance of the two
  constexpr double kRounding = 1e-9;  // a distance of two at one place
  for (const ColmapRigidPair& pair : rigid_pairs(model)) {
    GraphEdge edge{pair.a, pair.b, pair.a_from_b, Matrix6d::Zero(), false};
    const double distance = pair.a_from_b.translation().norm();
    const double shift = kShift * (distance > kRounding ? distance : 1);
    edge.information.diagonal() << Eigen::Vector3d::Constant(1 / (shift * shift)),
        Eigen::Vector3d::Constant(1 / (kTurn * kTurn));
    graph.edges.push_back(edge);
  }
}

GraphFile to_graph(const ColmapModel& model, std::vector<ColmapCameraPlace>& places) {
  const auto cameras = index_by_id<std::uint32_t>(model, model.cameras, "cameras", "camera");
  const auto images = index_by_id<std::uint32_t>(model, model.images, "images", "image");
  const auto points = index_by_id<std::uint64_t>(model, model.points, "points3D", "point");
  check_tracks(model, images);
  GraphFile file;
  FactorGraph& graph = file.graph;
  places = add_colmap_cameras(model, graph);
  for (const ColmapImage& image : model.images) {
    const auto camera = cameras.find(image.camera);
    if (camera == cameras.end()) {
      throw model.error("images", image.place, fmt::format("there is no camera {}", image.camera));
    }
    GraphFrame frame;
    frame.cam_from_world = image.cam_from_world;
    const ColmapCameraPlace& place = places[camera->second];
    if (place.kind == ColmapCameraPlace::Kind::kCamera) frame.camera = place.index;
    frame.fixed = graph.frames.empty();
    graph.frames.push_back(frame);
    file.frame_names.push_back(image.name);
  }
  for (const ColmapPoint& point : model.points) {
    graph.points.push_back({point.in_world});
    file.point_ids.push_back(point.id);
  }
  add_observations(model, cameras, points, places, graph);
  add_rigs(model, graph);
  return file;
}

// Mean distance between a point's projections and what was seen [px].
void update_errors(const FactorGraph& graph, ColmapModel& model) {
  std::vector<double> sums(graph.points.size());
  std::vector<int> counts(graph.points.size());
  for (const GraphObservation& o : graph.observations) {
    if (const auto squared = squared_error(graph, o)) {
      sums[o.point] += std::sqrt(*squared);
      ++counts[o.point];
    }
  }
  for (const GraphFactor& factor : graph.factors) {
    const std::uint32_t point = factor.variables[1].index;
    const double* const variables[] = {
        graph.frames[factor.variables[0].index].cam_from_world.params.data(),
        graph.points[point].in_world.data(), graph.blocks[factor.variables[2].index].values.data()};
    Eigen::Vector2d residual;
    if (factor.function->Evaluate(variables, residual.data(), nullptr)) {
      sums[point] += residual.norm();
      ++counts[point];
    }
  }
  for (std::size_t i = 0; i < sums.size(); ++i) {
    model.points[i].error = counts[i] == 0 ? -1 : sums[i] / counts[i];
  }
}

fs::path write_colmap(ColmapModel model, const std::vector<ColmapCameraPlace>& places,
                      const FactorGraph& graph, const fs::path& out, ColmapVariant variant) {
  for (std::size_t i = 0; i < model.cameras.size(); ++i) {
    take_colmap_camera(graph, places[i], model.cameras[i]);
  }
  for (std::size_t i = 0; i < model.images.size(); ++i) {
    model.images[i].cam_from_world = graph.frames[i].cam_from_world;
  }
  for (std::size_t i = 0; i < model.points.size(); ++i) {
    model.points[i].in_world = graph.points[i].in_world;
  }
  update_errors(graph, model);
  if (model.has_rigs) update_rigs(model);

  const fs::path folder = make_folder(out / "optimized");
  remove_colmap_model(folder);  // another variant's files would be taken for the result
  if (variant == ColmapVariant::kText) {
    write_colmap_text(folder, model);
  } else {
    write_colmap_binary(folder, model);
  }
  return folder;
}

}  // namespace

GraphFile read_colmap(const fs::path& folder, ColmapVariant variant) {
  const bool is_text = variant == ColmapVariant::kText;
  const auto model = std::make_shared<ColmapModel>(is_text ? read_colmap_text(folder)
                                                           : read_colmap_binary(folder));
  check_rigs(*model);
  std::vector<std::string> warnings = apply_rigs(*model);
  std::vector<ColmapCameraPlace> places;
  GraphFile file = to_graph(*model, places);
  file.warnings = std::move(warnings);
  const auto add_writer = [&](ColmapVariant written) {
    const GraphFormat format =
        written == ColmapVariant::kText ? GraphFormat::kColmapText : GraphFormat::kColmapBinary;
    file.writers.push_back({format, [model = std::shared_ptr<const ColmapModel>(model), places,
                                     written](const FactorGraph& graph, const fs::path& out) {
                              return write_colmap(*model, places, graph, out, written);
                            }});
  };
  add_writer(variant);
  add_writer(is_text ? ColmapVariant::kBinary : ColmapVariant::kText);
  file.format = file.writers.front().format;
  return file;
}

}  // namespace hybrid_slam
