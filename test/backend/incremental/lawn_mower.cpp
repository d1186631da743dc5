#include "test/backend/incremental/lawn_mower.h"

#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "test/backend/incremental/graph_feed.h"
#include "test/support/random.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

namespace {

constexpr double kAltitude = 3;  // [m]
constexpr double kSigma = 0.5;   // [px]
constexpr double kCell = 2;      // of the ground's grid [m]

using Cell = std::pair<int, int>;

Cell cell_of(double x, double y) {
  return {static_cast<int>(std::floor(x / kCell)), static_cast<int>(std::floor(y / kCell))};
}

// Looks down, its image's upper side ahead.
Rigid3d looking_down(double x, double y, double heading) {
  const Eigen::Quaterniond turned(Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()));
  const Eigen::Quaterniond down(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
  const double height = kAltitude + 0.2 * std::sin(0.3 * y + 0.2 * x);
  return inverse(Rigid3d(turned * down, {x, y, height}));
}

std::vector<Rigid3d> path(const LawnMowerOptions& options) {
  const int across = std::max(1, static_cast<int>(std::ceil(options.spacing / options.step)));
  std::vector<Rigid3d> poses;
  for (int track = 0; static_cast<int>(poses.size()) < options.keyframes; ++track) {
    const bool up = track % 2 == 0;
    const double length = options.step * (options.per_track - across);
    for (int i = 0; i < options.per_track - across; ++i) {
      const double along = options.step * i;
      poses.push_back(looking_down(options.spacing * track, up ? along : length - along,
                                   up ? 0 : std::numbers::pi));
    }
    for (int i = 0; i < across; ++i) {  // a half turn to the right, then one to the left
      const double part = (i + 0.5) / across;
      const double turn = std::numbers::pi * part;
      poses.push_back(looking_down(options.spacing * (track + part), up ? length : 0,
                                   up ? -turn : -std::numbers::pi + turn));
    }
  }
  poses.resize(static_cast<std::size_t>(options.keyframes));
  return poses;
}

class Survey {
 public:
  explicit Survey(const LawnMowerOptions& options) : options_(options) {
    graph_.cameras.push_back({camera_, 0});
    for (const Rigid3d& pose : path(options)) {
      graph_.frames.push_back({pose, 0, graph_.frames.empty()});
    }
    scatter();
    for (std::uint32_t i = 0; i < graph_.frames.size(); ++i) observe(i);
  }

  FactorGraph take() { return std::move(graph_); }

 private:
  void scatter() {
    const double footprint = kAltitude * kAltitude * camera_.width * camera_.height /
                             (camera_.params[0] * camera_.params[1]);
    const double tracks = std::ceil(static_cast<double>(options_.keyframes) / options_.per_track);
    const double margin = 3;
    const double wide = options_.spacing * tracks + 2 * margin;
    const double high = options_.step * options_.per_track + 2 * margin;
    const auto count =
        static_cast<std::uint32_t>(options_.observations_per_keyframe / footprint * wide * high);
    for (std::uint32_t i = 0; i < count; ++i) {
      const Eigen::Vector3d at(random_.uniform(-margin, wide - margin),
                               random_.uniform(-margin, high - margin), random_.uniform(-0.3, 0.3));
      cells_[cell_of(at.x(), at.y())].push_back(i);
      graph_.points.push_back({at, false});
    }
  }

  void observe(std::uint32_t frame) {
    const Rigid3d& cam_from_world = graph_.frames[frame].cam_from_world;
    const Eigen::Vector3d at = inverse(cam_from_world).translation();
    const Cell centre = cell_of(at.x(), at.y());
    for (int x = centre.first - 2; x <= centre.first + 2; ++x) {
      for (int y = centre.second - 2; y <= centre.second + 2; ++y) {
        for (const std::uint32_t p : cells_[{x, y}]) {
          const auto seen = project_stereo(camera_, cam_from_world * graph_.points[p].in_world);
          if (!seen || !in_image(camera_, seen->head<2>())) continue;
          graph_.observations.push_back({frame, p, *seen + random_.gaussian3(kSigma), kSigma});
        }
      }
    }
  }

  LawnMowerOptions options_;
  Random random_{1};
  Calibrated<RectifiedStereo> camera_ = synthetic_stereo_camera(0.2);
  std::map<Cell, std::vector<std::uint32_t>> cells_;
  FactorGraph graph_;
};

}  // namespace

FactorGraph lawn_mower_graph(const LawnMowerOptions& options) {
  FactorGraph graph = Survey(options).take();
  disturb(graph, 0.02, 0.002, 0.05, 9);
  return graph;
}

}  // namespace hybrid_slam
