#include "frontend/input/rectification.h"

#include <cmath>
#include <optional>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "cameras/kannala_brandt.h"

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

// The pixel of a ray; none if the camera cannot see it.
std::optional<Eigen::Vector2d> project(const RawCamera& camera, const Eigen::Vector3d& ray) {
  const std::vector<double>& k = camera.distortion;
  if (camera.is_fisheye) {
    const double params[] = {camera.fx, camera.fy, camera.cx, camera.cy, k[0], k[1], k[2], k[3]};
    Eigen::Vector2d pixel;
    if (!KannalaBrandt::project(params, ray.data(), pixel.data())) return std::nullopt;
    return pixel;
  }
  if (!(ray.z() > 0)) return std::nullopt;
  const auto coefficient = [&](std::size_t i) { return i < k.size() ? k[i] : 0; };
  const double x = ray.x() / ray.z(), y = ray.y() / ray.z();
  const double r2 = x * x + y * y;
  const double scale = (1 + r2 * (k[0] + r2 * (k[1] + r2 * coefficient(4)))) /
                       (1 + r2 * (coefficient(5) + r2 * (coefficient(6) + r2 * coefficient(7))));
  return Eigen::Vector2d(
      camera.fx * (x * scale + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x)) + camera.cx,
      camera.fy * (y * scale + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y) + camera.cy);
}

// Where the raw image shows the pixel (u, v) of a rectified one of this size and focal length.
std::optional<Eigen::Vector2d> raw_pixel(const RawCamera& camera,
                                         const Eigen::Matrix3d& raw_from_rectified, ImageSize size,
                                         double focal_length, double u, double v) {
  return project(camera,
                 raw_from_rectified * Eigen::Vector3d(u - 0.5 * (size.width - 1),
                                                      v - 0.5 * (size.height - 1), focal_length));
}

// Whether all of the rectified image's border lies in the raw image.
bool shows_only_seen(const RawCamera& camera, const Eigen::Matrix3d& raw_from_rectified,
                     ImageSize size, double focal_length) {
  constexpr int kSteps = 16;
  for (int i = 0; i <= kSteps; ++i) {
    const double u = i * (size.width - 1.0) / kSteps, v = i * (size.height - 1.0) / kSteps;
    for (const auto& [x, y] : {std::pair(u, 0.0), std::pair(u, size.height - 1.0),
                               std::pair(0.0, v), std::pair(size.width - 1.0, v)}) {
      const auto pixel = raw_pixel(camera, raw_from_rectified, size, focal_length, x, y);
      if (!pixel || !(pixel->minCoeff() >= 0) || !(pixel->x() <= camera.size.width - 1) ||
          !(pixel->y() <= camera.size.height - 1)) {
        return false;
      }
    }
  }
  return true;
}

RemapTable make_table(const RawCamera& camera, const Eigen::Matrix3d& raw_from_rectified,
                      ImageSize size, double focal_length) {
  cv::Mat by_x(size.height, size.width, CV_32FC1), by_y(size.height, size.width, CV_32FC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const auto pixel = raw_pixel(camera, raw_from_rectified, size, focal_length, x, y);
      by_x.at<float>(y, x) = pixel ? static_cast<float>(pixel->x()) : -1;
      by_y.at<float>(y, x) = pixel ? static_cast<float>(pixel->y()) : -1;
    }
  }
  RemapTable table;
  cv::convertMaps(by_x, by_y, table.whole, table.fraction, CV_16SC2);
  return table;
}

// Cubic: bilinear blurs by an amount that depends on the fraction of a pixel, which moves the
// extrema that SIFT looks for; Lanczos rings at the block borders of strongly compressed images.
void remap(GrayImage& image, const RemapTable& table) {
  const int width = table.whole.cols, height = table.whole.rows;
  GrayImage result{width, height,
                   std::vector<std::uint8_t>(static_cast<std::size_t>(width) *
                                             static_cast<std::size_t>(height))};
  const cv::Mat source(image.height, image.width, CV_8UC1, image.pixels.data());
  cv::Mat target(height, width, CV_8UC1, result.pixels.data());
  cv::remap(source, target, table.whole, table.fraction, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  image = std::move(result);
}

}  // namespace

struct StereoRectifier::Maps {
  RemapTable left, right;
};

StereoRectifier::StereoRectifier(const RawCamera& left, const RawCamera& right,
                                 const Rigid3d& right_from_left, const std::string& source)
    : right_size_(right.size) {
  const Eigen::Vector3d translation = right_from_left.translation();
  // What is made of a length has its square, which must be neither 0 nor infinite.
  if (!std::isnormal(translation.squaredNorm())) {
    throw InputError(source + ": the baseline is zero, or too small or large to be a length");
  }
  // Otherwise the pair stands one above the other, looks apart, or has its cameras exchanged.
  if (!(-translation.x() > 2 * std::hypot(translation.y(), translation.z()))) {
    throw InputError(source + ": the right camera does not stand to the right of the left one");
  }
  if (!(right_from_left.rotation().toRotationMatrix().trace() > 2)) {  // 60 degrees
    throw InputError(source + ": the two cameras look in different directions");
  }
  if (left.is_fisheye || right.is_fisheye || left.size != right.size) {
    rectify_wide(left, right, right_from_left, source);
  } else {
    rectify_like_opencv(left, right, right_from_left);
  }
}

void StereoRectifier::rectify_like_opencv(const RawCamera& left, const RawCamera& right,
                                          const Rigid3d& right_from_left) {
  const Eigen::Matrix3d rotation = right_from_left.rotation().toRotationMatrix();
  const Eigen::Vector3d translation = right_from_left.translation();
  cv::Mat cv_rotation(3, 3, CV_64F), cv_translation(3, 1, CV_64F);
  for (int r = 0; r < 3; ++r) {
    cv_translation.at<double>(r) = translation[r];
    for (int c = 0; c < 3; ++c) cv_rotation.at<double>(r, c) = rotation(r, c);
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

// The rows run along the baseline; of all such pairs of axes, the one that looks where the two
// cameras look on average.
void StereoRectifier::rectify_wide(const RawCamera& left, const RawCamera& right,
                                   const Rigid3d& right_from_left, const std::string& source) {
  const Rigid3d left_from_right = inverse(right_from_left);
  const Eigen::Vector3d x = left_from_right.translation().normalized();
  const Eigen::Vector3d ahead =
      Eigen::Vector3d::UnitZ() + left_from_right.rotation() * Eigen::Vector3d::UnitZ();
  Eigen::Matrix3d left_from_rectified;
  left_from_rectified.col(0) = x;
  left_from_rectified.col(1) = ahead.cross(x).normalized();
  left_from_rectified.col(2) = x.cross(left_from_rectified.col(1));
  const Eigen::Matrix3d right_from_rectified =
      right_from_left.rotation().toRotationMatrix() * left_from_rectified;
  const ImageSize size = left.size;
  cx_ = 0.5 * (size.width - 1);
  cy_ = 0.5 * (size.height - 1);
  baseline_ = left_from_right.translation().norm();
  raw_from_rectified_left_ =
      Rigid3d(Eigen::Quaterniond(left_from_rectified), Eigen::Vector3d::Zero());
  constexpr double kGrowth = 1.02, kMost = 8;
  const double least = 0.5 * (left.fx + left.fy);
  focal_length_ = least;
  while (!shows_only_seen(left, left_from_rectified, size, focal_length_) ||
         !shows_only_seen(right, right_from_rectified, size, focal_length_)) {
    focal_length_ *= kGrowth;
    if (focal_length_ > kMost * least) {
      throw InputError(source + ": the two cameras have no rectified view in common");
    }
  }
  maps_ =
      std::make_unique<Maps>(Maps{make_table(left, left_from_rectified, size, focal_length_),
                                  make_table(right, right_from_rectified, size, focal_length_)});
  const auto degrees = [&](int side) {
    return std::to_string(std::lround(2 * std::atan(0.5 * side / focal_length_) * 180 / M_PI));
  };
  note_ = source + ": rectified to a field of view of " + degrees(size.width) + " by " +
          degrees(size.height) + " degrees";
}

StereoRectifier::~StereoRectifier() = default;

void StereoRectifier::rectify_left(GrayImage& image) const { remap(image, maps_->left); }
void StereoRectifier::rectify_right(GrayImage& image) const { remap(image, maps_->right); }

}  // namespace hybrid_slam
