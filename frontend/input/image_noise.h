#pragma once

#include "frontend/features/definition/noise.h"
#include "frontend/features/image.h"

namespace hybrid_slam {

// Standard deviation of the noise from pixel to pixel [grey levels]: what no plane through 3x3
// pixels explains (Immerkaer, "Fast noise variance estimation", CVIU 1996), as a median, so that
// texture counts little: good cameras have 0.3 to 2 on natural scenes, up to 6 where foliage fills
// the view. An image smaller than 3x3 has none.
double image_noise(const GrayImage& image);

// The same at the sizes that features have: the larger one of what 3x3 neighbouring pixels say and
// what 3x3 pixels two apart do. Interpolation between pixels, as in rectification, takes half of
// white noise from neighbours and next to nothing of what features see. Texture counts more here:
// natural images have up to twice what image_noise() says.
double coarse_noise(const GrayImage& image);

// Whether the noise is beyond what good cameras have: image_noise() of 10 grey levels, or in
// proportion less where nothing but shot noise of little light fills less than a quarter of the
// range. `brightest`: grey level that 99 % of the pixels do not exceed.
bool is_noisy(const GrayImage& image);
bool is_noisy_in_the_dark(const GrayImage& image, double brightest);

// The variance of shot noise grows with the light. The square root has the same noise everywhere
// (Anscombe, "The transformation of Poisson, binomial and negative-binomial data", Biometrika
// 1948), as what looks for features supposes; it is scaled to fill the range.
void even_out_shot_noise(GrayImage& image, double brightest);

// Noise fills the finest scales with features of its own. The image is smoothed by a Gaussian as
// far as it takes to bring coarse_noise() down to 4 grey levels. What it carries then is returned.
sift::ImageNoise suppress_noise(GrayImage& image);

}  // namespace hybrid_slam
