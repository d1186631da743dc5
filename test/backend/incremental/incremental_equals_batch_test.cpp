#include <algorithm>
#include <cstdio>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "cameras/geometry/se3.h"
#include "test/backend/incremental/graph_feed.h"
#include "test/backend/incremental/scene_graph.h"
#include "test/support/pose_graphs.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

// Whether a frame closes a loop: the following updates may be used to settle.
using ClosesLoop = std::function<bool(std::uint32_t frame)>;

constexpr std::uint32_t kSettling = 3;  // updates, the closing one included

// Feeds a graph and compares the cost after every `stride`-th update, and after the last ones, with
// the optimum of the same factors.
void check_stream(const FactorGraph& graph, std::uint32_t stride,
                  const ClosesLoop& closes_loop = {}) {
  GraphFeed feed(graph, {});
  std::vector<double> excesses;
  std::uint32_t settled_at = 0;
  const auto count = static_cast<std::uint32_t>(graph.frames.size());
  for (std::uint32_t frame = 0; frame < count; ++frame) {
    feed.feed_next();
    if (closes_loop && closes_loop(frame)) settled_at = frame + kSettling;
    if (frame == 0 || frame < settled_at) continue;
    if (frame % stride == 0 || frame + 1 == count || frame == settled_at) {
      excesses.push_back(excess(feed.solver()));
    }
  }
  REQUIRE(excesses.size() > 5);
  std::sort(excesses.begin(), excesses.end());
  std::printf("%zu comparisons: median %.2g, worst %.2g above the optimum\n", excesses.size(),
              excesses[excesses.size() / 2], excesses.back());
  CHECK(excesses.front() > -1e-6);  // the batch solver found the optimum
  CHECK(excesses[excesses.size() / 2] < 1e-4);
  CHECK(excesses.back() < 1e-3);
}

// Frames whose landmarks were out of sight for `gap` frames or more, while those of the frame
// before were not.
ClosesLoop landmark_loops(const FactorGraph& graph, std::uint32_t gap) {
  std::vector<std::uint32_t> last_seen(graph.points.size(), 0);
  std::vector<int> again(graph.frames.size(), 0);
  for (const GraphObservation& observation : graph.observations) {  // by frame
    std::uint32_t& last = last_seen[observation.point];
    if (last > 0 && observation.frame > last + gap) ++again[observation.frame];
    last = std::max(observation.frame, 1U);
  }
  return [again](std::uint32_t frame) { return again[frame] > 0 && again[frame - 1] == 0; };
}

SyntheticSceneOptions orbit(int times, double circles) {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kOrbit;
  options.times = times;
  options.step = circles * 2 * std::numbers::pi * 3 / times;
  options.landmarks = 500;
  return options;
}

FactorGraph disturbed(FactorGraph graph) {
  disturb(graph, 0.02, 0.01, 0.05, 7);
  return graph;
}

void stereo_stream(std::uint32_t stride) {
  check_stream(disturbed(scene_graph(orbit(40, 0.6))), stride);
}

void corridor_stream(std::uint32_t stride) {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kCorridor;
  options.times = 50;
  options.step = 1;
  options.landmarks = 250;
  check_stream(disturbed(scene_graph(options)), stride);
}

void mixed_stream(std::uint32_t stride) {
  SyntheticSceneOptions options = orbit(30, 0.6);
  options.fisheye = true;
  options.landmarks = 250;
  check_stream(disturbed(scene_graph(options)), stride);
}

void stereo_loop_stream(std::uint32_t stride) {
  const FactorGraph graph = scene_graph(orbit(60, 1.4));
  const ClosesLoop loops = landmark_loops(graph, 15);
  check_stream(disturbed(graph), stride, loops);
}

void mixed_loop_stream(std::uint32_t stride) {
  SyntheticSceneOptions options = orbit(40, 1.3);
  options.fisheye = true;
  options.landmarks = 250;
  const FactorGraph graph = scene_graph(options);
  const ClosesLoop loops = landmark_loops(graph, 20);
  check_stream(disturbed(graph), stride, loops);
}

void ring_stream(std::uint32_t stride) {
  Random random(3);
  TestPoseGraph ring = ring_pose_graph(60, {0.02, 0.01}, random);
  // A second way round, beside the first, with an edge back to it now and then.
  FactorGraph& graph = ring.graph;
  const auto first_round = static_cast<std::uint32_t>(graph.edges.size());
  for (std::uint32_t i = 0; i < first_round; ++i) {
    GraphFrame again = graph.frames[i];
    again.fixed = false;
    graph.frames.push_back(again);
    GraphEdge edge = graph.edges[i];
    edge.a = i == 0 ? first_round - 1 : first_round + i - 1;
    edge.b = first_round + i;
    Vector6d error;
    error << random.gaussian3(0.02), random.gaussian3(0.01);
    edge.a_from_b = graph.frames[edge.a].cam_from_world *
                    inverse(graph.frames[edge.b].cam_from_world) * se3_exp(error);
    graph.edges.push_back(edge);
    if (i % 10 != 9) continue;
    edge.a = i;
    error << random.gaussian3(0.02), random.gaussian3(0.01);
    edge.a_from_b = graph.frames[edge.a].cam_from_world *
                    inverse(graph.frames[edge.b].cam_from_world) * se3_exp(error);
    graph.edges.push_back(edge);
  }
  disturb(graph, 0.05, 0.05, 0, 11);
  check_stream(graph, stride, [=](std::uint32_t frame) {
    return frame + 1 == first_round || (frame >= first_round && frame % 10 == 9);
  });
}

void grid_stream(std::uint32_t stride) {
  Random random(4);
  TestPoseGraph grid = grid_pose_graph({5, 5, 4}, {0.05, 0.03}, random);
  disturb(grid.graph, 0.1, 0.1, 0, 12);
  check_stream(grid.graph, stride);  // every frame of it closes a loop
}

// By name: what is fed, and every how many updates a quick test compares.
struct Scenario {
  const char* name;
  void (*run)(std::uint32_t stride);
};

constexpr Scenario kScenarios[] = {{"stereo", stereo_stream},
                                   {"corridor", corridor_stream},
                                   {"stereo and fisheye", mixed_stream},
                                   {"stereo with a loop", stereo_loop_stream},
                                   {"stereo and fisheye with a loop", mixed_loop_stream},
                                   {"pose graph of rounds", ring_stream},
                                   {"pose graph of a grid", grid_stream}};

TEST_CASE("incremental equals batch: every fifth update of every stream") {
  for (const Scenario& scenario : kScenarios) {
    DYNAMIC_SECTION(scenario.name) { scenario.run(5); }
  }
}

TEST_CASE("incremental equals batch: every update of every stream", "[slow]") {
  for (const Scenario& scenario : kScenarios) {
    DYNAMIC_SECTION(scenario.name) { scenario.run(1); }
  }
}

}  // namespace
}  // namespace hybrid_slam
