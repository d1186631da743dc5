#include "test/benchmark/mixed_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "cameras/geometry/se3.h"
#include "factors/make_reprojection_factor.h"
#include "test/backend/incremental/corridor.h"
#include "test/backend/mixed_graphs/test_factors.h"
#include "test/support/random.h"

namespace hybrid_slam {

namespace {

constexpr int kLandmarksPerStep = 5;
// Sightings of a landmark until it comes in: two of them, a step apart, leave GTSAM's behind the
// camera now and then.
constexpr std::size_t kEnough = 3;
constexpr double kOdometryWay = 0.02;    // [m]
constexpr double kOdometryTurn = 0.002;  // [rad]
constexpr double kRangeSigma = 0.05;     // [m]
constexpr double kRangeLimit = 30;       // [m]
constexpr double kBeaconSpacing = 25;    // [m]
constexpr double kBeaconSigma = 1;       // of where a beacon is said to be [m]
constexpr double kCalibrationSigma = 5;  // [px]
constexpr double kPixelSigma = 0.5;      // the corridor's [px]

void add_beacons(MixedStream& stream, Random& random) {
  const std::vector<Rigid3d>& truth = stream.truth;
  FactorGraph& graph = stream.graph;
  std::vector<Eigen::Vector3d> places;
  for (double z = 0; z < static_cast<double>(truth.size()); z += kBeaconSpacing) {
    places.emplace_back(random.uniform(-5, 5), random.uniform(-5, 5), z);
    GraphBlock beacon;
    beacon.values = places.back() + random.gaussian3(kBeaconSigma);
    graph.blocks.push_back(beacon);
  }
  for (std::uint32_t i = 0; i < truth.size(); ++i) {
    const Eigen::Vector3d centre = inverse(truth[i]).translation();
    for (std::uint32_t k = 0; k < places.size(); ++k) {
      const double range = (places[k] - centre).norm();
      if (range > kRangeLimit) continue;
      const double measured = range + kRangeSigma * random.gaussian();
      stream.steps[i].ranges.push_back({k + 1, measured});
      stream.steps[i].factors.push_back(static_cast<std::uint32_t>(graph.factors.size()));
      graph.factors.push_back(
          {range_factor(measured, kRangeSigma), {pose_variable(i), block_variable(k + 1)}});
    }
  }
}

void add_sighting(MixedStream& stream, std::uint32_t step, const GraphObservation& seen) {
  FactorGraph& graph = stream.graph;
  stream.steps[step].sightings.push_back({seen.frame, seen.point, seen.measurement.head<2>()});
  stream.steps[step].factors.push_back(static_cast<std::uint32_t>(graph.factors.size()));
  graph.factors.push_back(
      {make_refining_reprojection_factor(graph.cameras[0].camera, seen.measurement, seen.sigma),
       {pose_variable(seen.frame), point_variable(seen.point),
        block_variable(MixedStream::kCalibration)}});
}

// Landmarks that are seen less often than kEnough are left out.
void add_sightings(MixedStream& stream, const std::vector<GraphObservation>& all) {
  std::vector<std::vector<GraphObservation>> waiting(stream.graph.points.size());
  for (const GraphObservation& seen : all) {
    std::vector<GraphObservation>& sightings = waiting[seen.point];
    sightings.push_back(seen);
    if (sightings.size() < kEnough) continue;
    if (sightings.size() > kEnough) {
      add_sighting(stream, seen.frame, seen);
      continue;
    }
    stream.steps[seen.frame].points.push_back(seen.point);
    for (const GraphObservation& each : sightings) add_sighting(stream, seen.frame, each);
  }
}

void add_odometry(MixedStream& stream, Random& random) {
  const std::vector<Rigid3d>& truth = stream.truth;
  FactorGraph& graph = stream.graph;
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(kOdometryWay), Eigen::Vector3d::Constant(kOdometryTurn);
  for (std::uint32_t i = 0; i + 1 < truth.size(); ++i) {
    Vector6d noise;
    noise << random.gaussian3(kOdometryWay), random.gaussian3(kOdometryTurn);
    GraphEdge edge;
    edge.a = i;
    edge.b = i + 1;
    edge.a_from_b = truth[i] * inverse(truth[i + 1]) * se3_exp(noise);
    edge.information = sigma.cwiseAbs2().cwiseInverse().asDiagonal();
    graph.edges.push_back(edge);
    graph.frames[i + 1].cam_from_world = inverse(edge.a_from_b) * graph.frames[i].cam_from_world;
  }
}

}  // namespace

MixedStream mixed_stream(int steps) {
  Random random(3);
  MixedStream stream;
  FactorGraph& graph = stream.graph;
  graph = corridor_graph(steps, kLandmarksPerStep);
  stream.steps.resize(graph.frames.size());
  stream.truth = corridor_poses(steps);
  const auto& stereo = std::get<Calibrated<RectifiedStereo>>(graph.cameras[0].camera);
  Calibrated<Pinhole> camera;
  camera.width = stereo.width;
  camera.height = stereo.height;
  std::copy_n(stereo.params.begin(), camera.params.size(), camera.params.begin());
  graph.cameras[0].camera = camera;
  GraphBlock calibration;
  calibration.values = Eigen::Map<const Eigen::VectorXd>(camera.params.data(), 4);
  for (double& value : calibration.values) value += kCalibrationSigma * random.gaussian();
  calibration.shared = true;
  graph.blocks.push_back(calibration);
  add_beacons(stream, random);
  const std::vector<GraphObservation> seen = std::exchange(graph.observations, {});
  add_sightings(stream, seen);
  add_odometry(stream, random);
  for (std::uint32_t i = 0; i < graph.blocks.size(); ++i) {
    stream.prior_factors.push_back(static_cast<std::uint32_t>(graph.factors.size()));
    const Eigen::VectorXd& value = graph.blocks[i].values;
    graph.factors.push_back({i == MixedStream::kCalibration
                                 ? value_factor<4>(value, kCalibrationSigma)
                                 : value_factor<3>(value, kBeaconSigma),
                             {block_variable(i)}});
  }
  return stream;
}

namespace {

void append_pose(const Rigid3d& pose, std::string& text) {
  for (const int i : {4, 5, 6, 0, 1, 2, 3}) {  // translation, quaternion x y z w
    fmt::format_to(std::back_inserter(text), " {}", pose.params[i]);
  }
  text += '\n';
}

}  // namespace

std::string stream_text(const MixedStream& stream) {
  const FactorGraph& graph = stream.graph;
  std::string text;
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "SIGMAS {} {} {} {} {} {}\n", kOdometryWay, kOdometryTurn, kRangeSigma,
                 kBeaconSigma, kCalibrationSigma, kPixelSigma);
  for (std::uint32_t i = 0; i < graph.blocks.size(); ++i) {
    fmt::format_to(out, "{} {}", i == MixedStream::kCalibration ? "CALIBRATION" : "BEACON", i);
    for (const double value : graph.blocks[i].values) fmt::format_to(out, " {}", value);
    text += '\n';
  }
  for (std::uint32_t i = 0; i < stream.steps.size(); ++i) {
    const MixedStream::Step& step = stream.steps[i];
    fmt::format_to(out, "STEP {}", i);
    append_pose(i == 0 ? inverse(graph.frames[0].cam_from_world) : graph.edges[i - 1].a_from_b,
                text);
    for (const auto& range : step.ranges) {
      fmt::format_to(out, "RANGE {} {}\n", range.block, range.measured);
    }
    for (const std::uint32_t point : step.points) {
      const Eigen::Vector3d in_cam = stream.truth[i] * graph.points[point].in_world;
      fmt::format_to(out, "POINT {} {} {} {}\n", point, in_cam.x(), in_cam.y(), in_cam.z());
    }
    for (const auto& seen : step.sightings) {
      fmt::format_to(out, "SEEN {} {} {} {}\n", seen.frame, seen.point, seen.pixel.x(),
                     seen.pixel.y());
    }
  }
  return text;
}

void read_estimate(const std::string& path, FactorGraph& graph) {
  std::ifstream in(path);
  std::string kind;
  std::size_t index = 0;
  while (in >> kind >> index) {
    if (kind == "POSE") {  // world_from_cam
      Rigid3d pose;
      for (const int i : {4, 5, 6, 0, 1, 2, 3}) in >> pose.params[i];
      graph.frames.at(index).cam_from_world = inverse(pose);
    } else if (kind == "POINT") {
      for (double& value : graph.points.at(index).in_world) in >> value;
    } else {
      for (double& value : graph.blocks.at(index).values) in >> value;
    }
  }
  if (!in.eof()) throw std::runtime_error(path + ": not an estimate");
}

}  // namespace hybrid_slam
