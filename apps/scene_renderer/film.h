#pragma once

#include <cstdint>
#include <vector>

#include "apps/scene_renderer/view_renderer.h"

namespace hybrid_slam {

// The lens' faults and the sensor.
struct FilmOptions {
  float blur = 0.55F;       // [px] standard deviation of the lens' spread
  float vignetting = 0.4F;  // share of the light lost in the corners
  float noise = 1.6F;       // [grey levels] standard deviation
  float bright = 0.42F;     // share of full scale that the exposure gives the 90th percentile
  float photons = 0;        // electrons of a white pixel, which come by chance; 0: any number
  float read_noise = 0;     // [electrons] standard deviation, if they are counted
};

struct ColorImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;  // blue, green, red
};

// The exposure that the camera would choose: factor on the radiance.
float exposure_for(const RadianceImage& image, const ViewRays& rays, const FilmOptions& options);

// The picture: vignetting, blur, exposure, shot and read noise, gamma 2.2, noise (all of which
// depends on `seed` and the pixel). Black outside the field of view.
ColorImage develop(const RadianceImage& image, const ViewRays& rays, float exposure,
                   const FilmOptions& options, std::uint32_t seed, int threads);

}  // namespace hybrid_slam
