#include "apps/io/graphs/bal.h"

#include <fmt/format.h>

#include <limits>

#include "apps/io/graphs/landmark_index.h"
#include "apps/io/graphs/text_scanner.h"
#include "cameras/files/output_file.h"
#include "cameras/geometry/so3.h"

namespace hybrid_slam {

namespace {

constexpr std::uint32_t kMaxCount = std::numeric_limits<std::uint32_t>::max() - 1;
constexpr std::uint32_t kRefineAll = 0b111;

struct Header {
  std::uint32_t cameras = 0, points = 0, observations = 0;
};

// Fields may be spread over lines as one likes.
std::uint32_t next_integer(TextScanner& in, std::string_view what, std::uint32_t max) {
  in.more();
  return static_cast<std::uint32_t>(in.integer(what, max));
}

double next_number(TextScanner& in, std::string_view what) {
  in.more();
  return in.number(what);
}

Eigen::Vector3d next_vector(TextScanner& in, std::string_view what) {
  const double x = next_number(in, what);
  const double y = next_number(in, what);
  return {x, y, next_number(in, what)};
}

Header read_header(TextScanner& in) {
  Header header;
  header.cameras = next_integer(in, "number of cameras", kMaxCount);
  header.points = next_integer(in, "number of points", kMaxCount);
  header.observations = next_integer(in, "number of observations", kMaxCount);
  // The shortest possible are "0 " per number.
  in.expect_room_for(header.cameras, 9 * 2 - 1, "cameras");
  in.expect_room_for(header.points, 3 * 2 - 1, "points");
  in.expect_room_for(header.observations, 4 * 2 - 1, "observations");
  if (header.cameras == 0) in.fail("there are no cameras");
  return header;
}

void read_observations(TextScanner& in, const Header& header, FactorGraph& graph) {
  ObservationSet seen;
  graph.observations.reserve(header.observations);
  for (std::uint32_t i = 0; i < header.observations; ++i) {
    GraphObservation observation;
    observation.frame = next_integer(in, "observation's camera", header.cameras - 1);
    if (header.points == 0) in.fail("an observation, but there are no points");
    observation.point = next_integer(in, "observation's point", header.points - 1);
    observation.measurement[0] = next_number(in, "u");
    observation.measurement[1] = next_number(in, "v");
    if (!seen.insert(observation.frame, observation.point)) {
      in.fail(
          fmt::format("camera {} observes point {} twice", observation.frame, observation.point));
    }
    graph.observations.push_back(observation);
  }
}

}  // namespace

GraphFile read_bal(const std::filesystem::path& path) {
  TextScanner in(path);
  const Header header = read_header(in);
  GraphFile file;
  file.format = GraphFormat::kBal;
  FactorGraph& graph = file.graph;
  read_observations(in, header, graph);
  for (std::uint32_t i = 0; i < header.cameras; ++i) {
    GraphFrame frame;
    const Eigen::Vector3d angle_axis = next_vector(in, "camera's rotation");
    const Eigen::Vector3d translation = next_vector(in, "camera's translation");
    frame.cam_from_world = Rigid3d(so3_exp(angle_axis), translation);
    frame.camera = i;
    frame.fixed = i == 0;
    graph.frames.push_back(frame);
    const Eigen::Vector3d intrinsics = next_vector(in, "camera's f, k1, k2");
    graph.cameras.push_back(
        {Calibrated<Bal>{{intrinsics[0], intrinsics[1], intrinsics[2]}}, kRefineAll});
    file.frame_names.push_back(std::to_string(i));
  }
  for (std::uint32_t i = 0; i < header.points; ++i) {
    graph.points.push_back({next_vector(in, "point")});
    file.point_ids.push_back(i);
  }
  in.expect_end_of_file();
  file.writers.push_back(
      {GraphFormat::kBal, [](const FactorGraph& result, const std::filesystem::path& folder) {
         write_bal(folder / "optimized.txt", result);
         return folder / "optimized.txt";
       }});
  return file;
}

void write_bal(const std::filesystem::path& path, const FactorGraph& graph) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "{} {} {}\n", graph.frames.size(), graph.points.size(),
                 graph.observations.size());
  for (const GraphObservation& o : graph.observations) {
    fmt::format_to(out, "{} {} {} {}\n", o.frame, o.point, o.measurement[0], o.measurement[1]);
  }
  const auto write_each = [&](const auto& values) {
    for (const double value : values) fmt::format_to(out, "{}\n", value);
  };
  for (const GraphFrame& frame : graph.frames) {
    write_each(so3_log(Eigen::Quaterniond(frame.cam_from_world.rotation())));
    write_each(frame.cam_from_world.translation());
    write_each(std::get<Calibrated<Bal>>(graph.cameras.at(frame.camera).camera).params);
  }
  for (const GraphPoint& point : graph.points) write_each(point.in_world);
  write_file(path, {text.data(), text.size()});
}

}  // namespace hybrid_slam
