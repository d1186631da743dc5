#include "apps/io/graphs/g2o.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <span>

#include "apps/io/graphs/g2o_text.h"
#include "apps/pose_graph/connected_parts.h"
#include "cameras/files/output_file.h"
#include "cameras/geometry/se3.h"
#include "factors/point_in_frame.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace {

// Makes a graph of what the text says.
class G2oResolver {
 public:
  G2oResolver(G2oText& text, std::vector<std::string>& warnings)
      : text_(text), warnings_(warnings) {}

  void resolve() {
    if (!text_.priors.empty()) add_world();
    resolve_edges();
    resolve_priors();
    resolve_point_edges();
    fix_vertices();
  }

 private:
  // The world as a frame, before all others.
  void add_world() {
    GraphFrame world;
    world.fixed = true;
    text_.graph.frames.insert(text_.graph.frames.begin(), world);
    text_.frame_names.insert(text_.frame_names.begin(), "world");
    for (auto& [id, node] : text_.nodes) node.index += node.is_point ? 0 : 1;
    for (G2oItem& item : text_.items) {
      const bool is_frame =
          item.kind == G2oItemKind::kSpacePose || item.kind == G2oItemKind::kPlanePose;
      if (is_frame) ++item.index;
    }
  }

  G2oNode node_of(std::uint64_t id, int line) const {
    const auto found = text_.nodes.find(id);
    if (found == text_.nodes.end()) {
      throw line_error(text_.path, line, fmt::format("there is no vertex {}", id));
    }
    return found->second;
  }

  std::uint32_t index_of(std::uint64_t id, bool is_point, int line) const {
    const G2oNode node = node_of(id, line);
    if (node.is_point != is_point) {
      throw line_error(text_.path, line,
                       fmt::format("vertex {} is {}", id, node.is_point ? "a point" : "a pose"));
    }
    return node.index;
  }

  Rigid3d body_from_sensor(bool has_offset, std::uint64_t id, int line) const {
    if (!has_offset) return {};
    const auto found = text_.offsets.find(id);
    if (found != text_.offsets.end()) return found->second;
    throw line_error(text_.path, line, fmt::format("there is no parameter {}", id));
  }

  void resolve_edges() {
    for (std::size_t i = 0; i < text_.edge_ends.size(); ++i) {
      GraphEdge& edge = text_.graph.edges[i];
      edge.a = index_of(text_.edge_ends[i].a, false, text_.edge_ends[i].line);
      edge.b = index_of(text_.edge_ends[i].b, false, text_.edge_ends[i].line);
      edge.loop = edge.b != edge.a + 1;
    }
  }

  // With E the error of the body and O the sensor on it, the error of the sensor is O^-1 E O: to
  // first order the adjoint of O^-1 times that of the body.
  void resolve_priors() {
    for (const G2oPrior& prior : text_.priors) {
      const Rigid3d offset = body_from_sensor(prior.has_offset, prior.offset, prior.line);
      const Matrix6d sensor_from_body = adjoint(inverse(offset));
      GraphEdge edge;
      edge.a = 0;
      edge.b = index_of(prior.vertex, false, prior.line);
      edge.a_from_b = prior.world_from_sensor * inverse(offset);
      const Matrix6d information =
          sensor_from_body.transpose() * prior.information * sensor_from_body;
      edge.information = 0.5 * (information + information.transpose());
      text_.graph.edges.push_back(edge);
    }
  }

  void resolve_point_edges() {
    for (const G2oPointEdge& edge : text_.point_edges) {
      GraphFactor factor;
      factor.function = std::make_shared<PointInFrame>(
          edge.measured, edge.information,
          inverse(body_from_sensor(edge.has_offset, edge.offset, edge.ends.line)));
      factor.variables = {pose_variable(index_of(edge.ends.a, false, edge.ends.line)),
                          point_variable(index_of(edge.ends.b, true, edge.ends.line))};
      text_.graph.factors.push_back(std::move(factor));
    }
  }

  void fix_vertices() {
    FactorGraph& graph = text_.graph;
    for (const auto& [id, line] : text_.fixed) {
      const G2oNode node = node_of(id, line);
      (node.is_point ? graph.points[node.index].fixed : graph.frames[node.index].fixed) = true;
    }
    const std::size_t frames = graph.frames.size();
    ConnectedParts parts(frames + graph.points.size());
    for (const GraphEdge& edge : graph.edges) parts.join(edge.a, edge.b);
    for (const GraphFactor& factor : graph.factors) {
      parts.join(factor.variables[0].index, frames + factor.variables[1].index);
    }
    std::vector<std::size_t> size(frames + graph.points.size());
    std::vector<char> held(size.size());
    for (std::size_t i = 0; i < size.size(); ++i) {
      ++size[parts.part_of(i)];
      if (i < frames && graph.frames[i].fixed) held[parts.part_of(i)] = 1;
    }
    for (std::size_t i = 0; i < frames; ++i) {
      if (parts.part_of(i) == i && !held[i]) graph.frames[i].fixed = true;
    }
    const auto count = std::count_if(size.begin(), size.end(), [](std::size_t n) { return n > 0; });
    if (count < 2) return;
    warnings_.push_back(fmt::format(
        "{}: {} parts that no edge joins, {} of {} vertices in the largest; in each part "
        "that has neither a FIX nor a prior the first vertex is fixed",
        text_.path.string(), count, *std::max_element(size.begin(), size.end()),
        text_.nodes.size()));
  }

  G2oText& text_;
  std::vector<std::string>& warnings_;
};

void append_numbers(std::span<const double> values, fmt::memory_buffer& text) {
  for (const double value : values) fmt::format_to(std::back_inserter(text), " {}", value + 0.0);
}

void append_vertex(const G2oItem& item, const FactorGraph& graph, fmt::memory_buffer& text) {
  if (item.kind == G2oItemKind::kSpacePoint || item.kind == G2oItemKind::kPlanePoint) {
    const Eigen::Vector3d& p = graph.points[item.index].in_world;
    append_numbers({p.data(), item.kind == G2oItemKind::kSpacePoint ? 3U : 2U}, text);
    return;
  }
  const Rigid3d pose = inverse(graph.frames[item.index].cam_from_world);
  if (item.kind == G2oItemKind::kPlanePose) {
    const auto q = pose.rotation();
    const double theta = 2 * std::atan2(q.w() < 0 ? -q.z() : q.z(), std::abs(q.w()));
    append_numbers(std::array{pose.translation().x(), pose.translation().y(), theta}, text);
    return;
  }
  const auto& p = pose.params;  // quaternion x y z w, translation
  append_numbers(std::array{p[4], p[5], p[6], p[0], p[1], p[2], p[3]}, text);
}

void write_g2o(const std::filesystem::path& path, const FactorGraph& graph,
               const std::vector<G2oItem>& items) {
  fmt::memory_buffer text;
  for (const G2oItem& item : items) {
    text.append(item.text);
    if (item.kind != G2oItemKind::kOther) append_vertex(item, graph, text);
    text.push_back('\n');
  }
  write_file(path, {text.data(), text.size()});
}

}  // namespace

GraphFile read_g2o(const std::filesystem::path& path) {
  G2oText text = read_g2o_text(path);
  GraphFile file;
  file.format = GraphFormat::kG2o;
  G2oResolver(text, file.warnings).resolve();
  file.warnings.insert(file.warnings.end(), text.warnings.begin(), text.warnings.end());
  file.graph = std::move(text.graph);
  file.frame_names = std::move(text.frame_names);
  file.point_ids = std::move(text.point_ids);
  const auto items = std::make_shared<const std::vector<G2oItem>>(std::move(text.items));
  file.writers.push_back(
      {GraphFormat::kG2o, [items](const FactorGraph& graph, const std::filesystem::path& folder) {
         write_g2o(folder / "optimized.g2o", graph, *items);
         return folder / "optimized.g2o";
       }});
  return file;
}

}  // namespace hybrid_slam
