#include "test/apps/graphs/graph_checks.h"

#include <cmath>
#include <cstdlib>
#include <iostream>

#include <catch2/catch.hpp>

#include "test/support/temp_folder.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

Eigen::Vector3d error_of(const FactorGraph& graph, const GraphObservation& o) {
  const GraphFrame& frame = graph.frames.at(o.frame);
  const Camera& camera = graph.cameras.at(frame.camera).camera;
  const Eigen::Vector3d point = frame.cam_from_world * graph.points.at(o.point).in_world;
  if (const auto stereo = project_stereo(camera, point)) return *stereo - o.measurement;
  const auto pixel = project(camera, point);
  if (!pixel) return Eigen::Vector3d::Zero();
  const Eigen::Vector2d error = *pixel - o.measurement.head<2>();
  return {error[0], error[1], 0};
}

double chi2_of(const FactorGraph& graph, const GraphEdge& edge) {
  const Rigid3d error = inverse(edge.a_from_b) * graph.frames.at(edge.a).cam_from_world *
                        inverse(graph.frames.at(edge.b).cam_from_world);
  const Eigen::Quaterniond rotation(error.rotation());
  Vector6d r;
  r << error.translation(), (rotation.w() < 0 ? -2 : 2) * rotation.vec();
  return r.dot(edge.information * r);
}

void check_same_items(const GraphFile& a, const GraphFile& b) {
  REQUIRE(a.format == b.format);
  REQUIRE(a.graph.frames.size() == b.graph.frames.size());
  REQUIRE(a.graph.cameras.size() == b.graph.cameras.size());
  REQUIRE(a.graph.observations.size() == b.graph.observations.size());
  REQUIRE(a.graph.edges.size() == b.graph.edges.size());
  CHECK(a.frame_names == b.frame_names);
  CHECK(a.point_ids == b.point_ids);
  for (std::size_t i = 0; i < a.graph.frames.size(); ++i) {
    CHECK(a.graph.frames[i].fixed == b.graph.frames[i].fixed);
    CHECK(a.graph.frames[i].camera == b.graph.frames[i].camera);
  }
  for (std::size_t i = 0; i < a.graph.cameras.size(); ++i) {
    CHECK(a.graph.cameras[i].refined == b.graph.cameras[i].refined);
  }
}

}  // namespace

std::optional<fs::path> shared_graphs() {
  const char* root = std::getenv("HYBRID_SLAM_DATA");
  if (root == nullptr) {
    std::cout << "SKIPPED: HYBRID_SLAM_DATA is not set\n";
    return std::nullopt;
  }
  return fs::path(root) / "graphs";
}

double reference_cost(const FactorGraph& graph) {
  double sum = 0;
  for (const GraphObservation& o : graph.observations) {
    sum += error_of(graph, o).squaredNorm() / (o.sigma * o.sigma);
  }
  for (const GraphEdge& edge : graph.edges) sum += chi2_of(graph, edge);
  return sum / 2;
}

std::string refusal(const fs::path& path) {
  try {
    read_graph(path);
    return {};
  } catch (const InputError& error) {
    return error.what();
  }
}

void check_faults(const std::string& file_name, const std::string& text,
                  const std::vector<Fault>& faults) {
  check_faults({{file_name, text}}, file_name, file_name, faults);
}

void check_faults(const TextFiles& files, const std::string& spoiled, const fs::path& input,
                  const std::vector<Fault>& faults) {
  const TempFolder folder;
  for (const auto& [name, text] : files) write_text(folder.path() / name, text);
  REQUIRE(refusal(folder.path() / input).empty());
  const fs::path path = folder.path() / spoiled;
  for (const Fault& fault : faults) {
    INFO("fault: " << fault.name);
    std::string text = files.at(spoiled);
    const std::size_t at = text.find(fault.from);
    REQUIRE(at != std::string::npos);
    write_text(path, text.replace(at, fault.from.size(), fault.to));
    const std::string reason = refusal(folder.path() / input);
    CHECK_THAT(reason, Catch::StartsWith(folder.path().string()));
    CHECK_THAT(reason, Catch::Contains(fault.reason));
    CHECK(reason.find('\n') == std::string::npos);
  }
}

void check_round_trip(const fs::path& path) {
  const TempFolder folder;
  const GraphFile file = read_graph(path);
  CHECK(file.graph.validate() == "");
  REQUIRE(file.writers.size() >= 1);
  REQUIRE(file.writers.front().format == file.format);
  const double cost = reference_cost(file.graph);
  for (const GraphWriter& writer : file.writers) {
    if (writer.format == GraphFormat::kMap) continue;  // holds positions as floats
    GraphFile again = read_graph(writer.write(file.graph, folder.path()));
    CHECK(again.format == writer.format);
    again.format = file.format;
    check_same_items(file, again);
    CHECK(std::abs(reference_cost(again.graph) - cost) <= 1e-12 * cost);
    fs::remove_all(folder.path() / "optimized");
  }
}

}  // namespace hybrid_slam
