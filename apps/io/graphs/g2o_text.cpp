#include "apps/io/graphs/g2o_text.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "apps/io/graphs/text_scanner.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace {

constexpr double kMaxNormError = 0.2;     // of a quaternion that is meant to be one
constexpr double kQuietNormError = 1e-2;  // text files carry few digits
constexpr const char* kKnownTags =
    "VERTEX_SE3:QUAT, VERTEX_TRACKXYZ, EDGE_SE3:QUAT, EDGE_SE3_TRACKXYZ, EDGE_SE3_PRIOR, "
    "PARAMS_SE3OFFSET, VERTEX_SE2, VERTEX_XY, EDGE_SE2, EDGE_SE2_XY, EDGE_PRIOR_SE2, "
    "EDGE_PRIOR_SE2_XY and FIX are";

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
  explicit G2oReader(const std::filesystem::path& path) : in_(path) { text_.path = path; }

  G2oText read() {
    while (in_.more()) read_line();
    if (text_.nodes.empty()) throw InputError(in_.path().string() + ": holds no vertices");
    warn();
    return std::move(text_);
  }

 private:
  void read_line() {
    G2oItem item;
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
      if (!text_.offsets.emplace(id, read_pose()).second) {
        in_.fail(fmt::format("parameter {} is there already", id));
      }
    } else if (tag == "FIX") {
      do {
        text_.fixed.emplace_back(in_.integer("vertex"), in_.line());
      } while (in_.more_on_line());
    } else {
      in_.fail(quote(tag) + " is not supported: " + kKnownTags);
    }
    in_.expect_end_of_line();
    text_.items.push_back(std::move(item));
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

  std::uint64_t read_vertex(const std::string& tag, bool is_point, G2oItem& item) {
    const std::uint64_t id = in_.integer("vertex");
    const std::size_t index = is_point ? text_.graph.points.size() : text_.graph.frames.size();
    item.index = static_cast<std::uint32_t>(index);
    item.text = fmt::format("{} {}", tag, id);
    if (!text_.nodes.emplace(id, G2oNode{is_point, item.index}).second) {
      in_.fail(fmt::format("vertex {} is there already", id));
    }
    return id;
  }

  void read_pose_vertex(const std::string& tag, G2oItem& item) {
    const bool is_plane = tag == "VERTEX_SE2";
    require_same_world(is_plane);
    item.kind = is_plane ? G2oItemKind::kPlanePose : G2oItemKind::kSpacePose;
    text_.frame_names.push_back(std::to_string(read_vertex(tag, false, item)));
    GraphFrame frame;
    frame.cam_from_world = inverse(is_plane ? read_plane_pose() : read_pose());
    text_.graph.frames.push_back(frame);
  }

  void read_point_vertex(const std::string& tag, G2oItem& item) {
    const bool is_plane = tag == "VERTEX_XY";
    require_same_world(is_plane);
    item.kind = is_plane ? G2oItemKind::kPlanePoint : G2oItemKind::kSpacePoint;
    text_.point_ids.push_back(read_vertex(tag, true, item));
    GraphPoint point;
    for (int i = 0; i < (is_plane ? 2 : 3); ++i) point.in_world[i] = in_.number("coordinate");
    text_.graph.points.push_back(point);
  }

  G2oEnds read_ends() {
    G2oEnds ends;
    ends.a = in_.integer("vertex");
    ends.b = in_.integer("vertex");
    ends.line = in_.line();
    if (ends.a == ends.b) in_.fail("the edge joins a vertex to itself");
    return ends;
  }

  void read_edge(bool is_plane) {
    require_same_world(is_plane);
    text_.edge_ends.push_back(read_ends());
    GraphEdge edge;
    edge.a_from_b = is_plane ? read_plane_pose() : read_pose();
    edge.information = is_plane ? in_space(read_information<3>()) : read_information<6>();
    text_.graph.edges.push_back(edge);
  }

  void read_point_edge(bool is_plane) {
    require_same_world(is_plane);
    G2oPointEdge edge;
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
    text_.point_edges.push_back(edge);
  }

  void read_prior() {
    require_same_world(false);
    G2oPrior prior;
    prior.vertex = in_.integer("vertex");
    prior.offset = in_.integer("parameter");
    prior.has_offset = true;
    prior.line = in_.line();
    prior.world_from_sensor = read_pose();
    prior.information = read_information<6>();
    text_.priors.push_back(prior);
  }

  void read_plane_prior(bool with_theta) {
    require_same_world(true);
    G2oPrior prior;
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
    text_.priors.push_back(prior);
  }

  void warn() {
    const std::string source = in_.path().string();
    for (std::string& warning : cuts_.warnings(source)) {
      text_.warnings.push_back(std::move(warning));
    }
    if (odd_quaternions_ == 0) return;
    text_.warnings.push_back(
        fmt::format("{}: {} quaternions are not of unit length and are normalised (worst in line "
                    "{}: {:.1f} % off)",
                    source, odd_quaternions_, worst_quaternion_line_, 100 * worst_norm_error_));
  }

  TextScanner in_;
  G2oText text_;
  std::optional<bool> is_plane_;
  InformationCuts cuts_;
  std::size_t odd_quaternions_ = 0;
  double worst_norm_error_ = 0;
  int worst_quaternion_line_ = 0;
};

}  // namespace

G2oText read_g2o_text(const std::filesystem::path& path) { return G2oReader(path).read(); }

}  // namespace hybrid_slam
