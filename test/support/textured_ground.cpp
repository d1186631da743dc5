#include "test/support/textured_ground.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "test/support/random.h"

namespace hybrid_slam {
namespace {

constexpr double kBackground = 90;     // grey value where there is no ground
constexpr double kFinestCell = 0.025;  // [m]
constexpr int kOctaves = 4;

std::uint64_t mix(std::uint64_t x) {  // splitmix64
  x += 0x9e3779b97f4a7c15U;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31);
}

// In [-1, 1], one value per point of the lattice.
double lattice(std::int64_t x, std::int64_t y, std::uint64_t seed) {
  const std::uint64_t bits =
      mix(mix(mix(seed) ^ static_cast<std::uint64_t>(x)) ^ static_cast<std::uint64_t>(y));
  return static_cast<double>(bits >> 11) * 0x1p-52 - 1;
}

double smooth(double t) { return t * t * t * (t * (6 * t - 15) + 10); }

double noise(double x, double y, std::uint64_t seed) {
  const double floor_x = std::floor(x), floor_y = std::floor(y);
  const auto i = static_cast<std::int64_t>(floor_x), j = static_cast<std::int64_t>(floor_y);
  const double s = smooth(x - floor_x), t = smooth(y - floor_y);
  return (1 - t) * ((1 - s) * lattice(i, j, seed) + s * lattice(i + 1, j, seed)) +
         t * ((1 - s) * lattice(i, j + 1, seed) + s * lattice(i + 1, j + 1, seed));
}

// Noise of several cell sizes, the lattices turned against each other.
double texture(double x, double y, std::uint64_t seed) {
  double sum = 125, cell = kFinestCell;
  for (int octave = 0; octave < kOctaves; ++octave, cell *= 2) {
    const double angle = 0.4 + 0.7 * octave;
    const double c = std::cos(angle) / cell, s = std::sin(angle) / cell;
    sum += 45 * noise(c * x - s * y, s * x + c * y, mix(seed + static_cast<std::uint64_t>(octave)));
  }
  return sum;
}

// A rectangle as one camera sees it.
struct SeenGround {
  const TexturedRectangle* rectangle;
  Eigen::Vector3d eye;             // the camera's centre, in the plane's frame
  Eigen::Matrix3d plane_from_eye;  // rotation
};

double grey(const std::vector<SeenGround>& rectangles, const Eigen::Vector3d& ray) {
  double nearest = std::numeric_limits<double>::infinity();
  const TexturedRectangle* hit = nullptr;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  for (const SeenGround& seen : rectangles) {
    const Eigen::Vector3d direction = seen.plane_from_eye * ray;
    const double length = -seen.eye.z() / direction.z();
    if (!(length > 0 && length < nearest)) continue;
    const Eigen::Vector3d cut = seen.eye + length * direction;
    if (std::abs(cut.x()) > seen.rectangle->half_width ||
        std::abs(cut.y()) > seen.rectangle->half_height) {
      continue;
    }
    nearest = length;
    hit = seen.rectangle;
    place = cut;
  }
  return hit == nullptr ? kBackground : texture(place.x(), place.y(), hit->seed);
}

}  // namespace

TexturedGround TexturedGround::with_steps() {
  Random random(5);
  std::vector<TexturedRectangle> rectangles;
  const Eigen::Quaterniond tilt(Eigen::AngleAxisd(-0.25, Eigen::Vector3d::UnitX()));
  rectangles.push_back({Rigid3d(tilt, Eigen::Vector3d(0, 0, 2.6)), 20, 20, 1});
  for (int i = 0; i < 10; ++i) {
    const Eigen::Vector3d centre(-1.2 + 0.28 * i, random.uniform(-0.8, 0.8),
                                 random.uniform(1.7, 2.3));
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(random.uniform(0, 0.3), random.direction()));
    const double half_width = random.uniform(0.1, 0.25);
    rectangles.push_back({Rigid3d(turn, centre), half_width, random.uniform(0.1, 0.25),
                          static_cast<std::uint64_t>(2 + i)});
  }
  return TexturedGround(std::move(rectangles));
}

GrayImage TexturedGround::render(const Camera& camera, const Rigid3d& world_from_cam) const {
  std::vector<SeenGround> rectangles;
  for (const TexturedRectangle& rectangle : rectangles_) {
    const Rigid3d plane_from_eye = inverse(rectangle.world_from_plane) * world_from_cam;
    rectangles.push_back(
        {&rectangle, plane_from_eye.translation(), plane_from_eye.rotation().toRotationMatrix()});
  }
  GrayImage image{image_width(camera), image_height(camera), {}};
  for (int v = 0; v < image.height; ++v) {
    for (int u = 0; u < image.width; ++u) {
      const auto ray = unproject(camera, Eigen::Vector2d(u, v));
      const double value = ray ? grey(rectangles, *ray) : 0;
      image.pixels.push_back(static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0))));
    }
  }
  return image;
}

}  // namespace hybrid_slam
