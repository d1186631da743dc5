#pragma once

#include <optional>
#include <span>
#include <string>

#include "cameras/camera.h"
#include "cameras/files/input_error.h"
#include "frontend/features/image.h"

namespace hybrid_slam {

// Which part of a fisheye image shows the world, and how it is prepared for features.
struct FisheyeViewOptions {
  double max_angle_deg = 0;  // to the axis, that the lens shows; 0: the image circle is looked for
  double border = 12;        // [px] left out along the circle
  std::string mask;          // file of an image; its zero pixels show nothing of the world
  double clahe = 0;          // clip limit of the local contrast enhancement; 0: none

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// Distance from the principal point [px of the mean focal length] at which the image circle of a
// fisheye ends: outside it all is dark, and inside it was brighter. None if no edge is seen: the
// image reaches to its corners, or what lies along the circle is as dark.
std::optional<double> find_image_circle(const Calibrated<KannalaBrandt>& camera,
                                        const GrayImage& image);

// Non-zero where the world is seen: within the model's range, max_angle_deg or else the circle
// found in most of `examples`, less the border, and where the mask allows. Throws InputError if the
// mask cannot be read or has another size, or if the model folds well within the circle.
GrayImage make_fisheye_mask(const Calibrated<KannalaBrandt>& camera,
                            std::span<const GrayImage> examples, const FisheyeViewOptions& options);

// Contrast-limited adaptive histogram equalisation over tiles of an eighth of the image. `clip`:
// as in OpenCV, 2 to 4 are usual.
void enhance_contrast(GrayImage& image, double clip);

}  // namespace hybrid_slam
