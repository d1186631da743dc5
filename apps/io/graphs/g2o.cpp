#include "apps/io/graphs/g2o.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <unordered_map>

#include "apps/io/graphs/text_scanner.h"
#include "cameras/files/output_file.h"
#include "frontend/input/pose_rows.h"

namespace hybrid_slam {

namespace {

// What the text says, before ids are looked up: a vertex may follow the edges that name it.
struct EdgeLine {
  std::uint64_t a = 0, b = 0;
  int line = 0;
};

struct G2oReader {
  explicit G2oReader(const std::filesystem::path& path) : in(path) {}

  TextScanner in;
  FactorGraph graph;
  std::vector<std::uint64_t> ids;                           // by frame
  std::unordered_map<std::uint64_t, std::uint32_t> frames;  // by id
  std::vector<EdgeLine> edge_lines;                         // by edge
  std::vector<std::pair<std::uint64_t, int>> fixed;         // id and line

  void read_line() {
    const std::string_view tag = in.field("tag");
    if (tag == "VERTEX_SE3:QUAT") {
      read_vertex();
    } else if (tag == "EDGE_SE3:QUAT") {
      read_edge();
    } else if (tag == "FIX") {
      do {
        fixed.emplace_back(in.integer("vertex"), in.line());
      } while (in.more_on_line());
    } else {
      in.fail(quote(tag) + " is not supported: VERTEX_SE3:QUAT, EDGE_SE3:QUAT and FIX are");
    }
    in.expect_end_of_line();
  }

  Rigid3d read_pose() {
    double v[7];
    for (double& value : v) value = in.number("one of the pose's 7 numbers");
    const Eigen::Quaterniond rotation =
        checked_rotation(v[6], v[3], v[4], v[5], in.path(), in.line());
    return {rotation, Eigen::Vector3d(v[0], v[1], v[2])};
  }

  void read_vertex() {
    const std::uint64_t id = in.integer("vertex");
    if (!frames.emplace(id, static_cast<std::uint32_t>(ids.size())).second) {
      in.fail(fmt::format("vertex {} is there already", id));
    }
    ids.push_back(id);
    GraphFrame frame;
    frame.cam_from_world = inverse(read_pose());
    graph.frames.push_back(frame);
  }

  void read_edge() {
    EdgeLine ends;
    ends.a = in.integer("vertex");
    ends.b = in.integer("vertex");
    ends.line = in.line();
    if (ends.a == ends.b) in.fail("the edge joins a vertex to itself");
    GraphEdge edge;
    edge.a_from_b = read_pose();
    for (int row = 0; row < 6; ++row) {
      for (int column = row; column < 6; ++column) {
        const double value = in.number("one of the 21 numbers of the information");
        edge.information(row, column) = edge.information(column, row) = value;
      }
    }
    if (Eigen::LLT<Matrix6d>(edge.information).info() != Eigen::Success) {
      in.fail("the information is not positive definite");
    }
    graph.edges.push_back(edge);
    edge_lines.push_back(ends);
  }

  std::uint32_t frame_of(std::uint64_t id, int line) const {
    const auto found = frames.find(id);
    if (found == frames.end()) {
      throw line_error(in.path(), line, fmt::format("there is no vertex {}", id));
    }
    return found->second;
  }

  void resolve_ids() {
    if (ids.empty()) throw InputError(in.path().string() + ": holds no vertices");
    for (std::size_t i = 0; i < graph.edges.size(); ++i) {
      GraphEdge& edge = graph.edges[i];
      edge.a = frame_of(edge_lines[i].a, edge_lines[i].line);
      edge.b = frame_of(edge_lines[i].b, edge_lines[i].line);
      edge.loop = edge.b != edge.a + 1;
    }
    for (const auto& [id, line] : fixed) graph.frames[frame_of(id, line)].fixed = true;
    if (fixed.empty()) graph.frames.front().fixed = true;
  }
};

void append_pose(fmt::memory_buffer& text, const Rigid3d& pose) {
  for (const int i : {4, 5, 6, 0, 1, 2, 3}) {  // translation, quaternion x y z w
    fmt::format_to(std::back_inserter(text), " {}", pose.params[i]);
  }
}

void write_g2o(const std::filesystem::path& path, const FactorGraph& graph,
               const std::vector<std::uint64_t>& ids, const std::vector<std::uint64_t>& fixed) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  for (std::size_t i = 0; i < graph.frames.size(); ++i) {
    fmt::format_to(out, "VERTEX_SE3:QUAT {}", ids[i]);
    append_pose(text, inverse(graph.frames[i].cam_from_world));
    text.push_back('\n');
  }
  for (const std::uint64_t id : fixed) fmt::format_to(out, "FIX {}\n", id);
  for (const GraphEdge& edge : graph.edges) {
    fmt::format_to(out, "EDGE_SE3:QUAT {} {}", ids[edge.a], ids[edge.b]);
    append_pose(text, edge.a_from_b);
    for (int row = 0; row < 6; ++row) {
      for (int column = row; column < 6; ++column) {
        fmt::format_to(out, " {}", edge.information(row, column));
      }
    }
    text.push_back('\n');
  }
  write_file(path, {text.data(), text.size()});
}

}  // namespace

GraphFile read_g2o(const std::filesystem::path& path) {
  G2oReader reader(path);
  while (reader.in.more()) reader.read_line();
  reader.resolve_ids();
  GraphFile file;
  file.format = GraphFormat::kG2o;
  file.graph = std::move(reader.graph);
  for (const std::uint64_t id : reader.ids) file.frame_names.push_back(std::to_string(id));
  std::vector<std::uint64_t> fixed;
  for (const auto& [id, line] : reader.fixed) fixed.push_back(id);
  file.writers.push_back(
      {GraphFormat::kG2o, [ids = std::move(reader.ids), fixed = std::move(fixed)](
                              const FactorGraph& graph, const std::filesystem::path& folder) {
         write_g2o(folder / "optimized.g2o", graph, ids, fixed);
         return folder / "optimized.g2o";
       }});
  return file;
}

}  // namespace hybrid_slam
