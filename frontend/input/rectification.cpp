#include "frontend/input/rectification.h"

#include <cmath>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace hybrid_slam {

namespace {

cv::Mat camera_matrix(const RawCamera& camera) {
  return (cv::Mat_<double>(3, 3) << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
}

cv::Mat distortion(const RawCamera& camera) {
  return cv::Mat(camera.distortion, true).reshape(1, 1);
}

struct RemapTable {
  cv::Mat whole, fraction;  // fixed point: whole pixels, and index of the interpolation weights
};

RemapTable make_table(const RawCamera& camera, const cv::Mat& rotation, const cv::Mat& projection) {
  RemapTable table;
  cv::initUndistortRectifyMap(camera_matrix(camera), distortion(camera), rotation, projection,
                              cv::Size(camera.size.width, camera.size.height), CV_16SC2,
                              table.whole, table.fraction);
  return table;
}

// Cubic: bilinear blurs by an amount that depends on the fraction of a pixel, which moves the
// extrema that SIFT looks for; Lanczos rings at the block borders of strongly compressed images.
void remap(GrayImage& image, const RemapTable& table) {
  GrayImage result{image.width, image.height, std::vector<std::uint8_t>(image.pixels.size())};
  const cv::Mat source(image.height, image.width, CV_8UC1, image.pixels.data());
  cv::Mat target(image.height, image.width, CV_8UC1, result.pixels.data());
  cv::remap(source, target, table.whole, table.fraction, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  image = std::move(result);
}

}  // namespace

struct StereoRectifier::Maps {
  RemapTable left, right;
};

StereoRectifier::StereoRectifier(const RawCamera& left, const RawCamera& right,
                                 const Rigid3d& right_from_left, const std::string& source) {
  if (left.size != right.size) throw InputError(source + ": the two cameras differ in image size");
  const Eigen::Matrix3d rotation = right_from_left.rotation().toRotationMatrix();
  const Eigen::Vector3d translation = right_from_left.translation();
  cv::Mat cv_rotation(3, 3, CV_64F), cv_translation(3, 1, CV_64F);
  for (int r = 0; r < 3; ++r) {
    cv_translation.at<double>(r) = translation[r];
    for (int c = 0; c < 3; ++c) cv_rotation.at<double>(r, c) = rotation(r, c);
  }
  // Otherwise the pair stands one above the other, looks apart, or has its cameras exchanged.
  if (!(-translation.x() > 2 * std::hypot(translation.y(), translation.z()))) {
    throw InputError(source + ": the right camera does not stand to the right of the left one");
  }
  if (!(rotation.trace() > 2)) {  // 60 degrees
    throw InputError(source + ": the two cameras look in different directions");
  }
  cv::Mat left_rotation, right_rotation, left_projection, right_projection, disparity_to_depth;
  cv::stereoRectify(camera_matrix(left), distortion(left), camera_matrix(right), distortion(right),
                    cv::Size(left.size.width, left.size.height), cv_rotation, cv_translation,
                    left_rotation, right_rotation, left_projection, right_projection,
                    disparity_to_depth, cv::CALIB_ZERO_DISPARITY, 0);
  focal_length_ = left_projection.at<double>(0, 0);
  cx_ = left_projection.at<double>(0, 2);
  cy_ = left_projection.at<double>(1, 2);
  baseline_ = -right_projection.at<double>(0, 3) / focal_length_;
  Eigen::Matrix3d rectified_from_raw;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) rectified_from_raw(r, c) = left_rotation.at<double>(r, c);
  }
  raw_from_rectified_left_ =
      Rigid3d(Eigen::Quaterniond(rectified_from_raw.transpose()), Eigen::Vector3d::Zero());
  maps_ = std::make_unique<Maps>(Maps{make_table(left, left_rotation, left_projection),
                                      make_table(right, right_rotation, right_projection)});
}

StereoRectifier::~StereoRectifier() = default;

void StereoRectifier::rectify_left(GrayImage& image) const { remap(image, maps_->left); }
void StereoRectifier::rectify_right(GrayImage& image) const { remap(image, maps_->right); }

}  // namespace hybrid_slam
