#include "frontend/input/rectifiable_camera.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace hybrid_slam {
namespace {

using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

bool is_word(const std::string& word, std::initializer_list<const char*> words) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

void set_distortion(const YamlSection& file, const std::string& key, std::vector<double> d,
                    const std::string& model, RawCamera& camera) {
  camera.is_fisheye = is_word(model, {"equidistant", "fisheye", "kannala_brandt"});
  if (!camera.is_fisheye &&
      !is_word(model, {"plumb_bob", "rational_polynomial", "rational", "none", ""})) {
    file.fail("distortion_model", "'" + model +
                                      "' is not supported (plumb_bob, rational_polynomial, "
                                      "equidistant are)");
  }
  if (d.empty()) d.assign(4, 0.0);
  const std::size_t count = d.size();
  if (camera.is_fisheye ? count != 4 : count != 4 && count != 5 && count != 8) {
    file.fail(key, camera.is_fisheye ? "must have 4 numbers" : "must have 4, 5 or 8 numbers");
  }
  camera.distortion = std::move(d);
}

// Whether raw and rectified images of the camera are the same.
bool is_rectified_already(const RectifiableCamera& camera,
                          const Calibrated<RectifiedStereo>& rectified) {
  constexpr double kSame = 1e-6;
  const RawCamera& raw = camera.raw;
  const auto& [fx, fy, cx, cy, baseline] = rectified.params;
  const auto differ = [](double a, double b) { return !(std::abs(a - b) <= kSame * b); };
  return !raw.is_fisheye && camera.rectified_from_raw.isIdentity(kSame) &&
         std::all_of(raw.distortion.begin(), raw.distortion.end(),
                     [](double d) { return d == 0; }) &&
         !differ(raw.fx, fx) && !differ(raw.fy, fy) && !differ(raw.cx, cx) && !differ(raw.cy, cy);
}

}  // namespace

RectifiableCamera make_rectifiable_camera(const YamlSection& file, CameraMatrices matrices,
                                          const std::string& model, ImageSize size) {
  RectifiableCamera camera;
  const std::vector<double>& k = matrices.k;
  if (k[1] != 0 || k[3] != 0 || !(k[0] > 0) || !(k[4] > 0)) {
    file.fail(matrices.k_key, "is no camera's");
  }
  camera.raw.fx = k[0], camera.raw.fy = k[4], camera.raw.cx = k[2], camera.raw.cy = k[5];
  camera.raw.size = size;
  set_distortion(file, matrices.d_key, std::move(matrices.d), model, camera.raw);
  camera.rectified_from_raw = RowMajor3d(matrices.r.data());
  constexpr double kTolerance = 1e-3;
  if (!((camera.rectified_from_raw * camera.rectified_from_raw.transpose() -
         Eigen::Matrix3d::Identity())
            .norm() < kTolerance)) {
    file.fail(matrices.r_key, "is no rotation");
  }
  return camera;
}

void add_raw_pair(const RectifiableCamera& left, const RectifiableCamera& right,
                  PairCalibration& pair) {
  const Calibrated<RectifiedStereo>& rectified = pair.rectified.value();
  if (is_rectified_already(left, rectified) && is_rectified_already(right, rectified)) return;
  const Eigen::Matrix3d raw_from_rectified = right.rectified_from_raw.transpose();
  const Rigid3d right_from_left(
      Eigen::Quaterniond(raw_from_rectified * left.rectified_from_raw).normalized(),
      raw_from_rectified * Eigen::Vector3d(-rectified.params[4], 0, 0));
  pair.raw = RawPair{left.raw, right.raw, right_from_left};
}

}  // namespace hybrid_slam
