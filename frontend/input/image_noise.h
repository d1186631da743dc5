#pragma once

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

// Whether suppress_noise() would change the image.
bool is_noisy(const GrayImage& image);

// Where noise is beyond what good cameras have, in low light at high gain, it fills the finest
// scales with features of its own. The image is smoothed by a Gaussian as far as it takes to bring
// coarse_noise() down to 4 grey levels, below what the default contrast threshold of SIFT lets
// through. False, and nothing changed, where image_noise() is below 10: 0.7 px of it would do.
bool suppress_noise(GrayImage& image);

}  // namespace hybrid_slam
