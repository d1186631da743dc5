#pragma once

#include <memory>
#include <string>
#include <vector>

#include "cameras/geometry/rigid3d.h"
#include "frontend/features/image.h"
#include "frontend/input/image_file.h"

namespace hybrid_slam {

// A raw camera: pinhole with radial-tangential or rational distortion (k1 k2 p1 p2, then k3, then
// k4 k5 k6; OpenCV's), or a fisheye (Kannala-Brandt).
struct RawCamera {
  double fx = 0, fy = 0, cx = 0, cy = 0;  // [px]
  std::vector<double> distortion;         // 4, 5 or 8; of a fisheye 4
  bool is_fisheye = false;
  ImageSize size;
};

// Maps a raw stereo pair onto a rectified one: rows aligned, one focal length and one principal
// point for both, every pixel inside the raw images. Immutable; safe to use from several threads.
// A pair of fisheyes, or of unequal size, becomes one of the left one's size with the focal length
// of the raw left image's middle, or more where the border would show what neither has seen.
class StereoRectifier {
 public:
  // `right_from_left`: between the raw cameras. Throws InputError, starting with `source`, if the
  // two cannot be rectified to a pair side by side with the left camera on the left.
  StereoRectifier(const RawCamera& left, const RawCamera& right, const Rigid3d& right_from_left,
                  const std::string& source);
  ~StereoRectifier();

  // Replace a raw image by the rectified one, of the left one's size.
  void rectify_left(GrayImage& image) const;
  void rectify_right(GrayImage& image) const;

  double focal_length() const { return focal_length_; }  // [px], both directions
  double cx() const { return cx_; }                      // [px]
  double cy() const { return cy_; }                      // [px]
  double baseline() const { return baseline_; }          // [m]
  ImageSize right_size() const { return right_size_; }   // of the raw image
  const Rigid3d& raw_from_rectified_left() const { return raw_from_rectified_left_; }

  // The field of view that was chosen for a pair of fisheyes or of unequal size, in words.
  const std::string& note() const { return note_; }

 private:
  struct Maps;
  void rectify_like_opencv(const RawCamera& left, const RawCamera& right,
                           const Rigid3d& right_from_left);
  void rectify_wide(const RawCamera& left, const RawCamera& right, const Rigid3d& right_from_left,
                    const std::string& source);

  std::unique_ptr<const Maps> maps_;
  double focal_length_ = 0;
  double cx_ = 0;
  double cy_ = 0;
  double baseline_ = 0;
  ImageSize right_size_;
  Rigid3d raw_from_rectified_left_;
  std::string note_;
};

}  // namespace hybrid_slam
