#pragma once

#include <array>
#include <memory>
#include <string>

#include "cameras/geometry/rigid3d.h"
#include "frontend/features/image.h"
#include "frontend/input/image_file.h"

namespace hybrid_slam {

// A raw camera: pinhole with radial-tangential distortion (k1 k2 p1 p2).
struct RawCamera {
  double fx = 0, fy = 0, cx = 0, cy = 0;  // [px]
  std::array<double, 4> distortion{};
  ImageSize size;
};

// Maps a raw stereo pair onto a rectified one: rows aligned, one focal length and one principal
// point for both, every pixel inside the raw images. Immutable; safe to use from several threads.
class StereoRectifier {
 public:
  // `right_from_left`: between the raw cameras. Throws InputError, starting with `source`, if the
  // two cannot be rectified to a pair side by side with the left camera on the left.
  StereoRectifier(const RawCamera& left, const RawCamera& right, const Rigid3d& right_from_left,
                  const std::string& source);
  ~StereoRectifier();

  // Replace a raw image by the rectified one of the same size.
  void rectify_left(GrayImage& image) const;
  void rectify_right(GrayImage& image) const;

  double focal_length() const { return focal_length_; }  // [px], both directions
  double cx() const { return cx_; }                      // [px]
  double cy() const { return cy_; }                      // [px]
  double baseline() const { return baseline_; }          // [m]
  const Rigid3d& raw_from_rectified_left() const { return raw_from_rectified_left_; }

 private:
  struct Maps;
  std::unique_ptr<const Maps> maps_;
  double focal_length_ = 0;
  double cx_ = 0;
  double cy_ = 0;
  double baseline_ = 0;
  Rigid3d raw_from_rectified_left_;
};

}  // namespace hybrid_slam
