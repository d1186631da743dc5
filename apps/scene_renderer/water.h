#pragma once

#include <vector>

#include <Eigen/Core>

#include "apps/scene_renderer/seabed_texture.h"

namespace hybrid_slam {

// What light meets on its way, per colour.
struct Water {
  Color attenuation{0.3F, 0.14F, 0.12F};   // [1/m] lost along a ray
  Color scattering{0.03F, 0.036F, 0.04F};  // [1/m] of that, scattered
  Color ambient{0.001F, 0.0035F, 0.004F};  // radiance from everywhere
};

struct Lamp {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // in the world [m]
  Eigen::Vector3f axis = Eigen::Vector3f::UnitZ();     // unit, middle of the beam
  Color intensity = Color::Ones();
  float beam = 1.5F;     // exponent of the cosine to the axis: larger is narrower
  float radius = 0.02F;  // [m] of its face: softens shadows
};

// Stirred sediment: extinction falls off as a Gaussian from the middle, torn by noise.
struct SiltCloud {
  Eigen::Vector3f centre = Eigen::Vector3f::Zero();  // in the world [m]
  float radius = 0.3F;                               // [m]
  float extinction = 0;                              // [1/m] in the middle
  std::uint32_t seed = 0;
};

struct Lighting {
  Water water;
  std::vector<Lamp> lamps;
  std::vector<SiltCloud> silt;
};

// Of a surface at `point` that faces the lamp, through the water, without shadows.
Color irradiance(const Lamp& lamp, const Water& water, const Eigen::Vector3f& point);

// Extinction by silt [1/m] at a point.
float silt_at(const std::vector<SiltCloud>& clouds, const Eigen::Vector3f& point);

// exp of each colour.
Color exp_of(const Color& exponent);

}  // namespace hybrid_slam
