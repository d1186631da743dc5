#include "apps/scene_renderer/port_dirt.h"

#include <algorithm>
#include <cmath>

#include "apps/scene_renderer/noise.h"

namespace hybrid_slam {
namespace {

constexpr float kCounts = 0.1F;  // stopped light from which a pixel counts as covered
constexpr float kStrayShare = 1 / 3.0F;

}  // namespace

std::vector<float> make_dirt(const ViewRays& rays, double share, std::uint32_t seed) {
  std::vector<float> dirt(rays.bearing.size(), 0);
  std::size_t in_view = 0, covered = 0;
  for (std::size_t pixel = 0; pixel < dirt.size(); ++pixel) in_view += rays.sees(pixel) ? 1 : 0;
  const auto width = static_cast<float>(rays.width), height = static_cast<float>(rays.height);
  Counter random(seed, 71);
  while (static_cast<double>(covered) < share * static_cast<double>(in_view)) {
    const float u = random.uniform(0, width), v = random.uniform(0, height);
    const float radius = width * random.uniform(0.015F, 0.07F);
    const float opacity = random.uniform(0.5F, 0.97F);
    const auto ragged = static_cast<std::uint32_t>(1e6F * random.uniform());
    const int first = std::max(0, static_cast<int>(v - 1.5F * radius));
    const int last = std::min(rays.height - 1, static_cast<int>(v + 1.5F * radius));
    for (int y = first; y <= last; ++y) {
      for (int x = 0; x < rays.width; ++x) {
        const auto pixel = static_cast<std::size_t>(y * rays.width + x);
        const Eigen::Vector3f off(static_cast<float>(x) - u, static_cast<float>(y) - v, 0);
        const float r = off.norm() / radius;
        if (r > 1.5F || !rays.sees(pixel)) continue;
        const float edge = 1 + 0.4F * gradient_noise(off / (0.5F * radius), ragged).value;
        const float stopped = opacity * (1 - smooth_step(0.5F * edge, edge, r));
        const bool before = dirt[pixel] >= kCounts;
        dirt[pixel] = std::max(dirt[pixel], stopped);
        covered += !before && dirt[pixel] >= kCounts ? 1 : 0;
      }
    }
  }
  return dirt;
}

void apply_dirt(const std::vector<float>& dirt, RadianceImage& image) {
  Color mean = Color::Zero();
  for (const Color& pixel : image.pixels) mean += pixel / static_cast<float>(image.pixels.size());
  for (std::size_t pixel = 0; pixel < dirt.size(); ++pixel) {
    image.pixels[pixel] += dirt[pixel] * (kStrayShare * mean - image.pixels[pixel]);
  }
}

}  // namespace hybrid_slam
