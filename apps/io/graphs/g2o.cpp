#include "apps/io/graphs/g2o.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <span>
#include <unordered_map>

#include "apps/io/graphs/g2o_information.h"
#include "apps/io/graphs/text_scanner.h"
#include "apps/pose_graph/connected_parts.h"
#include "cameras/files/output_file.h"
#include "factors/point_in_frame.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace {

constexpr double kMaxNormError = 0.2;     // of a quaternion that is meant to be one
constexpr double kQuietNormError = 1e-2;  // text files carry few digits
constexpr const char* kKnownTags =
    "VERTEX_SE3:QUAT, VERTEX_TRACKXYZ, EDGE_SE3:QUAT, EDGE_SE3_TRACKXYZ, EDGE_SE3_PRIOR, "
    "PARAMS_SE3OFFSET, VERTEX_SE2, VERTEX_XY, EDGE_SE2, EDGE_SE2_XY, EDGE_PRIOR_SE2, "
    "EDGE_PRIOR_SE2_XY and FIX are";

enum class ItemKind { kSpacePose, kSpacePoint, kPlanePose, kPlanePoint, kOther };

// A line of the file. All but vertices are written as they were read.
struct Item {
  ItemKind kind = ItemKind::kOther;
  std::uint32_t index = 0;  // of a vertex: among the frames or the points
  std::string text;         // of a vertex: tag and id
};

// A vertex: a frame or a point of the graph.
struct Node {
  bool is_point = false;
  std::uint32_t index = 0;
};

// What the text says, before ids are looked up: a vertex may follow the edges that name it.
struct Ends {
  std::uint64_t a = 0, b = 0;
  int line = 0;
};

struct PointEdge {
  Ends ends;
  std::uint64_t offset = 0;  // id
  bool has_offset = false;
  Eigen::Vector3d measured = Eigen::Vector3d::Zero();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
};

struct Prior {
  std::uint64_t vertex = 0;
  std::uint64_t offset = 0;  // id
  bool has_offset = false;
  int line = 0;
  Rigid3d world_from_sensor;
  Matrix6d information = Matrix6d::Zero();
};

// theta about the axis z.
Rigid3d plane_pose(double x, double y, double theta) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(theta, Eigen::Vector3d::UnitZ())),
          Eigen::Vector3d(x, y, 0)};
}

// An information over (x, y, theta) as one over translation and rotation in space.
Matrix6d in_space(const Eigen::Matrix3d& plane) {
  constexpr int kRow[] = {0, 1, 5};
  const auto or_one = [](double value) { return value > 0 ? value : 1; };
  Matrix6d space = Matrix6d::Zero();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) space(kRow[r], kRow[c]) = plane(r, c);
  }
  space(2, 2) = or_one(0.5 * (plane(0, 0) + plane(1, 1)));
  space(3, 3) = space(4, 4) = or_one(plane(2, 2));
  return space;
}

class G2oReader {
 public:
  explicit G2oReader(const std::filesystem::path& path) : in_(path) {}

  GraphFile read() {
    while (in_.more()) read_line();
    if (nodes_.empty()) throw InputError(in_.path().string() + ": holds no vertices");
    if (!priors_.empty()) add_world();
    resolve_edges();
    resolve_priors();
    resolve_point_edges();
    fix_vertices();
    warn();
    return std::move(file_);
  }

  std::vector<Item> items;

 private:
  void read_line() {
    Item item;
    item.text = in_.whole_line();
    const std::string tag(in_.field("tag"));
    if (tag == "VERTEX_SE3:QUAT" || tag == "VERTEX_SE2") {
      read_pose_vertex(tag, item);
    } else if (tag == "VERTEX_TRACKXYZ" || tag == "VERTEX_XY") {
      read_point_vertex(tag, item);
    } else if (tag == "EDGE_SE3:QUAT" || tag == "EDGE_SE2") {
      read_edge(tag == "EDGE_SE2");
    } else if (tag == "EDGE_SE3_TRACKXYZ" || tag == "EDGE_SE2_XY") {
      read_point_edge(tag == "EDGE_SE2_XY");
    } else if (tag == "EDGE_SE3_PRIOR") {
      read_prior();
    } else if (tag == "EDGE_PRIOR_SE2" || tag == "EDGE_PRIOR_SE2_XY") {
      read_plane_prior(tag == "EDGE_PRIOR_SE2");
    } else if (tag == "PARAMS_SE3OFFSET") {
      const std::uint64_t id = in_.integer("parameter");
      if (!offsets_.emplace(id, read_pose()).second) {
        in_.fail(fmt::format("parameter {} is there already", id));
      }
    } else if (tag == "FIX") {
      do {
        fixed_.emplace_back(in_.integer("vertex"), in_.line());
      } while (in_.more_on_line());
    } else {
      in_.fail(quote(tag) + " is not supported: " + kKnownTags);
    }
    in_.expect_end_of_line();
    items.push_back(std::move(item));
  }

  // All of a file is in space, or all of it in a plane.
  void require_same_world(bool is_plane) {
    if (is_plane_.value_or(is_plane) != is_plane) {
      in_.fail("one file holds items of a plane and of space");
    }
    is_plane_ = is_plane;
  }

  Rigid3d read_pose() {
    double v[7];
    for (double& value : v) value = in_.number("one of the pose's 7 numbers");
    Eigen::Quaterniond rotation(v[6], v[3], v[4], v[5]);
    const double error = std::abs(rotation.norm() - 1);
    if (!(error < kMaxNormError)) in_.fail("the quaternion is not of unit length");
    if (error > kQuietNormError) {
      if (odd_quaternions_++ == 0 || error > worst_norm_error_) {
        worst_norm_error_ = error;
        worst_quaternion_line_ = in_.line();
      }
    }
    return {rotation.normalized(), Eigen::Vector3d(v[0], v[1], v[2])};
  }

  Rigid3d read_plane_pose() {
    const double x = in_.number("x");
    const double y = in_.number("y");
    return plane_pose(x, y, in_.number("theta"));
  }

  template <int kSize>
  Eigen::Matrix<double, kSize, kSize> read_information() {
    Eigen::Matrix<double, kSize, kSize> information;
    for (int row = 0; row < kSize; ++row) {
      for (int column = row; column < kSize; ++column) {
        const double value = in_.number(
            fmt::format("one of the {} numbers of the information", kSize * (kSize + 1) / 2));
        information(row, column) = information(column, row) = value;
      }
    }
    return cuts_.cut(information, in_.line());
  }

  std::uint64_t read_vertex(const std::string& tag, bool is_point, Item& item) {
    const std::uint64_t id = in_.integer("vertex");
    const std::size_t index = is_point ? file_.graph.points.size() : file_.graph.frames.size();
    item.index = static_cast<std::uint32_t>(index);
    item.text = fmt::format("{} {}", tag, id);
    if (!nodes_.emplace(id, Node{is_point, item.index}).second) {
      in_.fail(fmt::format("vertex {} is there already", id));
    }
    return id;
  }

  void read_pose_vertex(const std::string& tag, Item& item) {
    const bool is_plane = tag == "VERTEX_SE2";
    require_same_world(is_plane);
    item.kind = is_plane ? ItemKind::kPlanePose : ItemKind::kSpacePose;
    file_.frame_names.push_back(std::to_string(read_vertex(tag, false, item)));
    GraphFrame frame;
    frame.cam_from_world = inverse(is_plane ? read_plane_pose() : read_pose());
    file_.graph.frames.push_back(frame);
  }

  void read_point_vertex(const std::string& tag, Item& item) {
    const bool is_plane = tag == "VERTEX_XY";
    require_same_world(is_plane);
    item.kind = is_plane ? ItemKind::kPlanePoint : ItemKind::kSpacePoint;
    file_.point_ids.push_back(read_vertex(tag, true, item));
    GraphPoint point;
    for (int i = 0; i < (is_plane ? 2 : 3); ++i) point.in_world[i] = in_.number("coordinate");
    file_.graph.points.push_back(point);
  }

  Ends read_ends() {
    Ends ends;
    ends.a = in_.integer("vertex");
    ends.b = in_.integer("vertex");
    ends.line = in_.line();
    if (ends.a == ends.b) in_.fail("the edge joins a vertex to itself");
    return ends;
  }

  void read_edge(bool is_plane) {
    require_same_world(is_plane);
    edge_ends_.push_back(read_ends());
    GraphEdge edge;
    edge.a_from_b = is_plane ? read_plane_pose() : read_pose();
    edge.information = is_plane ? in_space(read_information<3>()) : read_information<6>();
    file_.graph.edges.push_back(edge);
  }

  void read_point_edge(bool is_plane) {
    require_same_world(is_plane);
    PointEdge edge;
    edge.ends = read_ends();
    edge.has_offset = !is_plane;
    if (edge.has_offset) edge.offset = in_.integer("parameter");
    for (int i = 0; i < (is_plane ? 2 : 3); ++i) edge.measured[i] = in_.number("coordinate");
    if (is_plane) {
      edge.information.topLeftCorner<2, 2>() = read_information<2>();
      const double trace = edge.information.trace();
      edge.information(2, 2) = trace > 0 ? 0.5 * trace : 1;
    } else {
      edge.information = read_information<3>();
    }
    point_edges_.push_back(edge);
  }

  void read_prior() {
    require_same_world(false);
    Prior prior;
    prior.vertex = in_.integer("vertex");
    prior.offset = in_.integer("parameter");
    prior.has_offset = true;
    prior.line = in_.line();
    prior.world_from_sensor = read_pose();
    prior.information = read_information<6>();
    priors_.push_back(prior);
  }

  void read_plane_prior(bool with_theta) {
    require_same_world(true);
    Prior prior;
    prior.vertex = in_.integer("vertex");
    prior.line = in_.line();
    const double x = in_.number("x");
    const double y = in_.number("y");
    prior.world_from_sensor = plane_pose(x, y, with_theta ? in_.number("theta") : 0);
    if (with_theta) {
      prior.information = in_space(read_information<3>());
    } else {
      // Along the axes of the world: those of the prior, which does not turn.
      prior.information.topLeftCorner<2, 2>() = read_information<2>();
    }
    priors_.push_back(prior);
  }

  // The world as a frame, before all others.
  void add_world() {
    GraphFrame world;
    world.fixed = true;
    file_.graph.frames.insert(file_.graph.frames.begin(), world);
    file_.frame_names.insert(file_.frame_names.begin(), "world");
    for (auto& [id, node] : nodes_) node.index += node.is_point ? 0 : 1;
    for (Item& item : items) {
      const bool is_frame = item.kind == ItemKind::kSpacePose || item.kind == ItemKind::kPlanePose;
      if (is_frame) ++item.index;
    }
  }

  Node node_of(std::uint64_t id, int line) const {
    const auto found = nodes_.find(id);
    if (found == nodes_.end()) {
      throw line_error(in_.path(), line, fmt::format("there is no vertex {}", id));
    }
    return found->second;
  }

  std::uint32_t index_of(std::uint64_t id, bool is_point, int line) const {
    const Node node = node_of(id, line);
    if (node.is_point != is_point) {
      throw line_error(in_.path(), line,
                       fmt::format("vertex {} is {}", id, node.is_point ? "a point" : "a pose"));
    }
    return node.index;
  }

  Rigid3d body_from_sensor(bool has_offset, std::uint64_t id, int line) const {
    if (!has_offset) return {};
    const auto found = offsets_.find(id);
    if (found != offsets_.end()) return found->second;
    throw line_error(in_.path(), line, fmt::format("there is no parameter {}", id));
  }

  void resolve_edges() {
    for (std::size_t i = 0; i < edge_ends_.size(); ++i) {
      GraphEdge& edge = file_.graph.edges[i];
      edge.a = index_of(edge_ends_[i].a, false, edge_ends_[i].line);
      edge.b = index_of(edge_ends_[i].b, false, edge_ends_[i].line);
      edge.loop = edge.b != edge.a + 1;
    }
  }

  // With E the error of the body and O the sensor on it, the error of the sensor is O^-1 E O: to
  // first order the adjoint of O^-1 times that of the body.
  void resolve_priors() {
    for (const Prior& prior : priors_) {
      const Rigid3d offset = body_from_sensor(prior.has_offset, prior.offset, prior.line);
      const Matrix6d sensor_from_body = adjoint(inverse(offset));
      GraphEdge edge;
      edge.a = 0;
      edge.b = index_of(prior.vertex, false, prior.line);
      edge.a_from_b = prior.world_from_sensor * inverse(offset);
      const Matrix6d information =
          sensor_from_body.transpose() * prior.information * sensor_from_body;
      edge.information = 0.5 * (information + information.transpose());
      file_.graph.edges.push_back(edge);
    }
  }

  void resolve_point_edges() {
    for (const PointEdge& edge : point_edges_) {
      GraphFactor factor;
      factor.function = std::make_shared<PointInFrame>(
          edge.measured, edge.information,
          inverse(body_from_sensor(edge.has_offset, edge.offset, edge.ends.line)));
      factor.variables = {pose_variable(index_of(edge.ends.a, false, edge.ends.line)),
                          point_variable(index_of(edge.ends.b, true, edge.ends.line))};
      file_.graph.factors.push_back(std::move(factor));
    }
  }

  void fix_vertices() {
    FactorGraph& graph = file_.graph;
    for (const auto& [id, line] : fixed_) {
      const Node node = node_of(id, line);
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
    file_.warnings.push_back(fmt::format(
        "{}: {} parts that no edge joins, {} of {} vertices in the largest; in each part "
        "that has neither a FIX nor a prior the first vertex is fixed",
        in_.path().string(), count, *std::max_element(size.begin(), size.end()), nodes_.size()));
  }

  void warn() {
    const std::string source = in_.path().string();
    for (std::string& warning : cuts_.warnings(source)) {
      file_.warnings.push_back(std::move(warning));
    }
    if (odd_quaternions_ == 0) return;
    file_.warnings.push_back(
        fmt::format("{}: {} quaternions are not of unit length and are normalised (worst in line "
                    "{}: {:.1f} % off)",
                    source, odd_quaternions_, worst_quaternion_line_, 100 * worst_norm_error_));
  }

  TextScanner in_;
  GraphFile file_;
  std::optional<bool> is_plane_;
  std::unordered_map<std::uint64_t, Node> nodes_;       // by id
  std::unordered_map<std::uint64_t, Rigid3d> offsets_;  // body_from_sensor, by id
  std::vector<Ends> edge_ends_;                         // by edge
  std::vector<PointEdge> point_edges_;
  std::vector<Prior> priors_;
  std::vector<std::pair<std::uint64_t, int>> fixed_;  // id and line
  InformationCuts cuts_;
  std::size_t odd_quaternions_ = 0;
  double worst_norm_error_ = 0;
  int worst_quaternion_line_ = 0;
};

void append_numbers(std::span<const double> values, fmt::memory_buffer& text) {
  for (const double value : values) fmt::format_to(std::back_inserter(text), " {}", value + 0.0);
}

void append_vertex(const Item& item, const FactorGraph& graph, fmt::memory_buffer& text) {
  if (item.kind == ItemKind::kSpacePoint || item.kind == ItemKind::kPlanePoint) {
    const Eigen::Vector3d& p = graph.points[item.index].in_world;
    append_numbers({p.data(), item.kind == ItemKind::kSpacePoint ? 3U : 2U}, text);
    return;
  }
  const Rigid3d pose = inverse(graph.frames[item.index].cam_from_world);
  if (item.kind == ItemKind::kPlanePose) {
    const auto q = pose.rotation();
    const double theta = 2 * std::atan2(q.w() < 0 ? -q.z() : q.z(), std::abs(q.w()));
    append_numbers(std::array{pose.translation().x(), pose.translation().y(), theta}, text);
    return;
  }
  const auto& p = pose.params;  // quaternion x y z w, translation
  append_numbers(std::array{p[4], p[5], p[6], p[0], p[1], p[2], p[3]}, text);
}

void write_g2o(const std::filesystem::path& path, const FactorGraph& graph,
               const std::vector<Item>& items) {
  fmt::memory_buffer text;
  for (const Item& item : items) {
    text.append(item.text);
    if (item.kind != ItemKind::kOther) append_vertex(item, graph, text);
    text.push_back('\n');
  }
  write_file(path, {text.data(), text.size()});
}

}  // namespace

GraphFile read_g2o(const std::filesystem::path& path) {
  G2oReader reader(path);
  GraphFile file = reader.read();
  file.format = GraphFormat::kG2o;
  const auto items = std::make_shared<const std::vector<Item>>(std::move(reader.items));
  file.writers.push_back(
      {GraphFormat::kG2o, [items](const FactorGraph& graph, const std::filesystem::path& folder) {
         write_g2o(folder / "optimized.g2o", graph, *items);
         return folder / "optimized.g2o";
       }});
  return file;
}

}  // namespace hybrid_slam
