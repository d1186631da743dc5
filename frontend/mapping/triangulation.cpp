#include "frontend/mapping/triangulation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "frontend/mapping/epipolar_band.h"
#include "frontend/matching/descriptor_distance.h"

namespace hybrid_slam {
namespace {

// A keypoint without a landmark, and its ray.
struct OpenKeypoint {
  std::uint32_t index = 0;
  Eigen::Vector3d bearing;      // unit, in the camera
  double angular_variance = 0;  // [rad^2]
};

struct View {
  const Keyframe* keyframe = nullptr;
  const Camera* camera = nullptr;
  Rigid3d world_from_cam;
  double focal = 1;
  std::vector<OpenKeypoint> open;
  EpipolarBand band;  // of all that was open at first

  const FrameObservations& observations() const { return *keyframe->observations; }
  Eigen::Vector3d center() const { return world_from_cam.translation(); }
};

View make_view(const MapSnapshot& map, KeyframeId id) {
  const Keyframe& keyframe = map.at(id);
  View view{&keyframe, &map.camera(keyframe), inverse(keyframe.cam_from_world), 1, {}, {}};
  view.focal = focal_length(*view.camera);
  for (std::size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    const Keypoint& keypoint = view.observations().features.keypoints[i];
    if (keyframe.landmarks[i].valid()) {
      continue;
    }
    const auto bearing = unproject(*view.camera, Eigen::Vector2d(keypoint.x, keypoint.y));
    if (bearing) {
      const double sigma = keypoint.sigma / view.focal;
      view.open.push_back({static_cast<std::uint32_t>(i), *bearing, sigma * sigma});
      view.band.add(*bearing, sigma * sigma);
    }
  }
  return view;
}

double median_depth(const MapSnapshot& map, const Keyframe& keyframe) {
  std::vector<double> depths;
  for (const LandmarkId id : keyframe.landmarks) {
    const Landmark* landmark = id.valid() ? map.find(id) : nullptr;
    if (landmark != nullptr) {
      depths.push_back((keyframe.cam_from_world * landmark->point_in_world).norm());
    }
  }
  if (depths.empty()) {
    return std::numeric_limits<double>::infinity();
  }
  const auto middle = depths.begin() + static_cast<long>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

bool baseline_suffices(const MapSnapshot& map, const View& a, const View& b,
                       const TriangulationOptions& options) {
  const double distance = (a.center() - b.center()).norm();
  if (baseline(*a.camera) > 0) {
    return distance > baseline(*a.camera);
  }
  return distance > options.min_baseline_ratio * median_depth(map, *b.keyframe);
}

// The keypoint of `b` that fits best by descriptor among those in the epipolar band of `a`'s ray.
// None of `b` was taken out since the view was made. `near` is scratch.
std::optional<OpenKeypoint> match_along_epipolar(const View& a, const OpenKeypoint& ray,
                                                 const View& b, const Rigid3d& b_from_a,
                                                 const TriangulationOptions& options,
                                                 std::vector<std::uint32_t>& near) {
  const Eigen::Vector3d plane = b_from_a.translation().cross(b_from_a.rotation() * ray.bearing);
  const double norm = plane.norm();
  if (norm < 1e-12) {
    return std::nullopt;
  }
  const Eigen::Vector3d normal = plane / norm;
  const Descriptor& descriptor = a.observations().features.descriptors[ray.index];
  const int limit = to_squared_bytes(options.max_descriptor_distance);
  int best = std::numeric_limits<int>::max();
  int second = best;
  const OpenKeypoint* found = nullptr;
  const double band_factor = options.epipolar_sigmas * options.epipolar_sigmas;
  b.band.find(normal, ray.angular_variance, band_factor, near);
  for (const std::uint32_t i : near) {
    const OpenKeypoint& candidate = b.open[i];
    const double off_plane = normal.dot(candidate.bearing);
    if (off_plane * off_plane > band_factor * (candidate.angular_variance + ray.angular_variance)) {
      continue;
    }
    const int distance =
        squared_distance(descriptor, b.observations().features.descriptors[candidate.index]);
    if (distance < best) {
      second = best;
      best = distance;
      found = &candidate;
    } else {
      second = std::min(second, distance);
    }
  }
  if (found == nullptr || best > limit || best > options.ratio * options.ratio * second) {
    return std::nullopt;
  }
  return *found;
}

// Angle that a stereo pair subtends at a point it sees; 0 without a right match. The cosine of it.
double stereo_parallax_cosine(const View& view, std::uint32_t keypoint,
                              std::optional<Eigen::Vector3d>& point_in_cam) {
  point_in_cam.reset();
  if (!view.observations().has_right(keypoint)) {
    return 1;
  }
  const Keypoint& left = view.observations().features.keypoints[keypoint];
  point_in_cam =
      triangulate_stereo(*view.camera, {left.x, left.y, view.observations().u_right[keypoint]});
  return point_in_cam ? std::cos(2 * std::atan2(baseline(*view.camera) / 2, point_in_cam->norm()))
                      : 1;
}

// The point nearest to both rays; none where they are parallel or meet behind a camera.
std::optional<Eigen::Vector3d> intersect_rays(const Eigen::Vector3d& center_a,
                                              const Eigen::Vector3d& ray_a,
                                              const Eigen::Vector3d& center_b,
                                              const Eigen::Vector3d& ray_b) {
  const Eigen::Vector3d between = center_b - center_a;
  const double cosine = ray_a.dot(ray_b);
  const double determinant = 1 - cosine * cosine;
  if (determinant < 1e-12) {
    return std::nullopt;
  }
  const double along_a = (between.dot(ray_a) - cosine * between.dot(ray_b)) / determinant;
  const double along_b = (cosine * between.dot(ray_a) - between.dot(ray_b)) / determinant;
  if (along_a <= 0 || along_b <= 0) {
    return std::nullopt;
  }
  return 0.5 * (center_a + along_a * ray_a + center_b + along_b * ray_b);
}

std::optional<Eigen::Vector3d> point_from_pair(const View& a, const OpenKeypoint& in_a,
                                               const View& b, const OpenKeypoint& in_b,
                                               const TriangulationOptions& options) {
  const Eigen::Vector3d ray_a = a.world_from_cam.rotation() * in_a.bearing;
  const Eigen::Vector3d ray_b = b.world_from_cam.rotation() * in_b.bearing;
  const double cosine = ray_a.dot(ray_b);
  std::optional<Eigen::Vector3d> stereo_a;
  std::optional<Eigen::Vector3d> stereo_b;
  const double stereo_cosine_a = stereo_parallax_cosine(a, in_a.index, stereo_a);
  const double stereo_cosine_b = stereo_parallax_cosine(b, in_b.index, stereo_b);
  if (cosine < std::min(stereo_cosine_a, stereo_cosine_b) &&
      (stereo_a || stereo_b || cosine < options.max_parallax_cosine)) {
    return intersect_rays(a.center(), ray_a, b.center(), ray_b);
  }
  if (stereo_a && stereo_cosine_a <= stereo_cosine_b) {
    return a.world_from_cam * *stereo_a;
  }
  if (stereo_b) {
    return b.world_from_cam * *stereo_b;
  }
  return std::nullopt;
}

bool reprojects(const View& view, std::uint32_t index, const Eigen::Vector3d& point_in_world,
                const TriangulationOptions& options) {
  const Eigen::Vector3d point_in_cam = view.keyframe->cam_from_world * point_in_world;
  const Keypoint& keypoint = view.observations().features.keypoints[index];
  const double variance = keypoint.sigma * keypoint.sigma;
  if (view.observations().has_right(index)) {
    const auto predicted = project_stereo(*view.camera, point_in_cam);
    const Eigen::Vector3d measured(keypoint.x, keypoint.y, view.observations().u_right[index]);
    return predicted && (*predicted - measured).squaredNorm() <= options.chi2_stereo * variance;
  }
  const auto predicted = project(*view.camera, point_in_cam);
  return predicted && (*predicted - Eigen::Vector2d(keypoint.x, keypoint.y)).squaredNorm() <=
                          options.chi2_mono * variance;
}

bool scales_agree(const View& a, std::uint32_t in_a, const View& b, std::uint32_t in_b,
                  const Eigen::Vector3d& point_in_world, double max_ratio) {
  const double size_a = a.observations().features.keypoints[in_a].scale / a.focal *
                        (point_in_world - a.center()).norm();
  const double size_b = b.observations().features.keypoints[in_b].scale / b.focal *
                        (point_in_world - b.center()).norm();
  return size_a < max_ratio * size_b && size_b < max_ratio * size_a;
}

// Matches the open keypoints of both views; those that make a landmark are no longer open.
void triangulate_pair(View& a, const View& b, const TriangulationOptions& options,
                      std::vector<NewLandmark>& landmarks) {
  const Rigid3d b_from_a = b.keyframe->cam_from_world * a.world_from_cam;
  std::vector<char> used_b(b.observations().size(), 0);
  std::vector<std::uint32_t> near;
  std::erase_if(a.open, [&](const OpenKeypoint& ray) {
    const auto match = match_along_epipolar(a, ray, b, b_from_a, options, near);
    if (!match || used_b[match->index] != 0) {
      return false;
    }
    const auto point = point_from_pair(a, ray, b, *match, options);
    if (!point || !point->allFinite() || !reprojects(a, ray.index, *point, options) ||
        !reprojects(b, match->index, *point, options) ||
        !scales_agree(a, ray.index, b, match->index, *point, options.max_scale_ratio)) {
      return false;
    }
    used_b[match->index] = 1;
    std::vector<Observation> observations{{a.keyframe->id, ray.index},
                                          {b.keyframe->id, match->index}};
    std::sort(observations.begin(), observations.end());
    landmarks.push_back({*point, std::move(observations)});
    return true;
  });
}

}  // namespace

std::string TriangulationOptions::validate() const {
  if (stereo_neighbours < 0 || mono_neighbours < 0) {
    return "triangulation: stereo_neighbours and mono_neighbours must not be negative";
  }
  if (!(min_baseline_ratio >= 0)) return "triangulation: min_baseline_ratio must not be negative";
  if (!(max_parallax_cosine > 0 && max_parallax_cosine <= 1)) {
    return "triangulation: max_parallax_cosine must lie in (0, 1]";
  }
  if (!(max_descriptor_distance > 0) || !(epipolar_sigmas > 0)) {
    return "triangulation: max_descriptor_distance and epipolar_sigmas must be positive";
  }
  if (!(ratio > 0 && ratio <= 1)) return "triangulation: ratio must lie in (0, 1]";
  if (!(max_scale_ratio >= 1)) return "triangulation: max_scale_ratio must not be below 1";
  if (!(chi2_mono > 0) || !(chi2_stereo > 0)) {
    return "triangulation: chi2 thresholds must be positive";
  }
  return {};
}

MapEdit triangulate_with_neighbours(const MapSnapshot& map, KeyframeId keyframe,
                                    const TriangulationOptions& options) {
  MapEdit edit;
  View current = make_view(map, keyframe);
  const int limit =
      baseline(*current.camera) > 0 ? options.stereo_neighbours : options.mono_neighbours;
  for (const Covisible& covisible : map.covisible(keyframe, 1, static_cast<std::size_t>(limit))) {
    View neighbour = make_view(map, covisible.id);
    if (current.observations().features.kind == neighbour.observations().features.kind &&
        baseline_suffices(map, current, neighbour, options)) {
      triangulate_pair(current, neighbour, options, edit.new_landmarks);
    }
  }
  return edit;
}

}  // namespace hybrid_slam
