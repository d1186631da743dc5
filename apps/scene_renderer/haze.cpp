#include "apps/scene_renderer/haze.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "apps/scene_renderer/rows.h"

namespace hybrid_slam {
namespace {

constexpr int kSlices = 28;
constexpr float kFirstSlice = 0.04F;  // [m] of the first slice
constexpr float kLastSlice = 14.0F;   // [m] of the last: what lies beyond is not seen
constexpr float kPhase = 0.25F / std::numbers::pi_v<float>;  // scattering alike in all directions

const float kSlicesPerLog = static_cast<float>(kSlices - 1) / std::log(kLastSlice / kFirstSlice);

float slice_distance(int slice) {
  return kFirstSlice * std::exp(static_cast<float>(slice) / kSlicesPerLog);
}

HazeSample mix(const HazeSample& a, const HazeSample& b, float t) {
  return {a.transmittance + t * (b.transmittance - a.transmittance),
          a.inscatter + t * (b.inscatter - a.inscatter)};
}

}  // namespace

Haze::Haze(const Lighting& lighting, const ViewRays& rays, const Rigid3d& world_from_cam,
           int threads)
    : columns_(rays.node_columns), nodes_(rays.node_bearing.size() * kSlices) {
  const Eigen::Vector3f origin = world_from_cam.translation().cast<float>();
  const Eigen::Matrix3f rotation = world_from_cam.rotation().toRotationMatrix().cast<float>();
  for_rows(rays.node_rows, threads, [&](int row) {
    for (int column = 0; column < columns_; ++column) {
      const auto node = static_cast<std::size_t>(row * columns_ + column);
      integrate(lighting, origin, rotation * rays.node_bearing[node], &nodes_[node * kSlices]);
    }
  });
}

void Haze::integrate(const Lighting& lighting, const Eigen::Vector3f& origin,
                     const Eigen::Vector3f& direction, HazeSample* slices) const {
  HazeSample sum;
  float from = 0;
  for (int slice = 0; slice < kSlices; ++slice) {
    const float to = slice_distance(slice);
    const Eigen::Vector3f middle = origin + 0.5F * (from + to) * direction;
    const float silt = silt_at(lighting.silt, middle);
    const Color extinction = lighting.water.attenuation + silt;
    const Color scattering = lighting.water.scattering + 0.6F * silt;
    Color light = 4 * std::numbers::pi_v<float> * lighting.water.ambient;
    for (const Lamp& lamp : lighting.lamps) light += irradiance(lamp, lighting.water, middle);
    const Color through = exp_of(-(to - from) * extinction);
    // Light scattered evenly along the step, attenuated on its way out of it.
    sum.inscatter += sum.transmittance * (kPhase * light * scattering * (1 - through) / extinction);
    sum.transmittance *= through;
    slices[slice] = sum;
    from = to;
  }
}

HazeSample Haze::at(float x, float y, float distance) const {
  constexpr float kPerPixel = 1.0F / kHazeCell;
  const int column = static_cast<int>(x * kPerPixel), row = static_cast<int>(y * kPerPixel);
  const float tx = x * kPerPixel - static_cast<float>(column);
  const float ty = y * kPerPixel - static_cast<float>(row);
  const float depth = std::log(std::min(distance, kLastSlice) / kFirstSlice) * kSlicesPerLog;
  const float slice = std::clamp(depth, 0.0F, static_cast<float>(kSlices - 1) - 1e-3F);
  const auto below = static_cast<std::size_t>(slice);
  const float tz = slice - static_cast<float>(below);
  std::array<HazeSample, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto node = static_cast<std::size_t>((row + static_cast<int>(i / 2)) * columns_ + column +
                                               static_cast<int>(i % 2));
    const HazeSample* slices = &nodes_[node * kSlices + below];
    corners[i] = mix(slices[0], slices[1], tz);
  }
  return mix(mix(corners[0], corners[1], tx), mix(corners[2], corners[3], tx), ty);
}

}  // namespace hybrid_slam
