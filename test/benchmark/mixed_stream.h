#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// A camera goes down a corridor, a step of a metre at a time: odometry, ranges to beacons along the
// way, and landmarks seen through one calibration that is sought as well. As a graph, and in the
// order in which it comes in: a landmark with its third sighting, by which it is determined.
struct MixedStream {
  static constexpr std::uint32_t kCalibration = 0;  // the block; those behind it are beacons

  struct Range {
    std::uint32_t block;
    double measured;
  };
  struct Sighting {
    std::uint32_t frame;
    std::uint32_t point;
    Eigen::Vector2d pixel;
  };
  struct Step {
    std::vector<std::uint32_t> points;   // that come in
    std::vector<std::uint32_t> factors;  // likewise; of `graph`
    std::vector<Range> ranges;
    std::vector<Sighting> sightings;
  };

  std::vector<Rigid3d> truth;  // cam_from_world
  FactorGraph graph;           // edge i leads from frame i to frame i + 1
  std::vector<Step> steps;
  std::vector<std::uint32_t> prior_factors;  // of the blocks, in their order
};

MixedStream mixed_stream(int steps);

// As a text file, and the estimate of such a graph that a peer wrote: see peers/gtsam_mixed.py.
std::string stream_text(const MixedStream& stream);
void read_estimate(const std::string& path, FactorGraph& graph);

}  // namespace hybrid_slam
