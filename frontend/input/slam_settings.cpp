#include "frontend/input/slam_settings.h"

#include "frontend/input/pose_rows.h"
#include "frontend/input/rectifiable_camera.h"

namespace hybrid_slam {
namespace {

// A camera of ORB-SLAM's settings, "Camera1".
RawCamera read_orb_camera(const YamlSection& file, const std::string& name, bool is_fisheye,
                          ImageSize size) {
  RawCamera camera;
  const auto value = [&](const char* key) { return file.number(name + "." + key); };
  const auto value_or_0 = [&](const char* key) {
    return file.has(name + "." + key) ? value(key) : 0.0;
  };
  camera.fx = value("fx"), camera.fy = value("fy"), camera.cx = value("cx"),
  camera.cy = value("cy");
  if (!(camera.fx > 0 && camera.fy > 0))
    file.fail(name + ".fx", "the focal length is not positive");
  camera.is_fisheye = is_fisheye;
  camera.size = size;
  if (is_fisheye) {
    camera.distortion = {value("k1"), value("k2"), value("k3"), value("k4")};
  } else {
    camera.distortion = {value_or_0("k1"), value_or_0("k2"), value_or_0("p1"), value_or_0("p2"),
                         value_or_0("k3")};
  }
  return camera;
}

// A camera of ORB-SLAM2's settings for images that it rectifies itself, "LEFT".
RectifiableCamera read_orb_matrices(const YamlSection& file, const std::string& name,
                                    ImageSize size) {
  CameraMatrices matrices{name + ".K", name + ".D", name + ".R", {}, {}, {}};
  matrices.k = file.matrix(matrices.k_key, 3, 3);
  matrices.d = file.child(matrices.d_key).numbers("data");
  matrices.r = file.matrix(matrices.r_key, 3, 3);
  if (file.has(name + ".width")) size = image_size_of(file, name + ".width", name + ".height");
  return make_rectifiable_camera(file, std::move(matrices), "plumb_bob", size);
}

void read_rectified_orb_pair(const YamlSection& file, ImageSize size, PairCalibration& result) {
  const std::string prefix = file.has("Camera1.fx") ? "Camera1." : "Camera.";
  const double fx = file.number(prefix + "fx");
  const double baseline =
      file.has("Camera.bf") ? file.number("Camera.bf") / fx : file.number("Stereo.b");
  result.rectified = make_stereo_camera(fx, file.number(prefix + "fy"), file.number(prefix + "cx"),
                                        file.number(prefix + "cy"), baseline, size, result.source);
  if (file.has("LEFT.K") && file.has("RIGHT.K")) {
    add_raw_pair(read_orb_matrices(file, "LEFT", size), read_orb_matrices(file, "RIGHT", size),
                 result);
  }
}

// Keys of a section or, in OpenVSLAM's files, with its name before them.
struct Keys {
  YamlSection section;
  std::string prefix;
  std::string operator()(const std::string& key) const { return prefix + key; }
};

Keys keys_of(const YamlSection& file, const std::string& name) {
  return file.has_section(name) ? Keys{file.child(name), ""} : Keys{file, name + "."};
}

RectifiableCamera read_stella_camera(const Keys& rectifier, const std::string& side,
                                     ImageSize size) {
  const YamlSection& section = rectifier.section;
  CameraMatrices matrices{
      rectifier("K_" + side), rectifier("D_" + side), rectifier("R_" + side), {}, {}, {}};
  matrices.k = section.numbers(matrices.k_key, 9);
  matrices.d = section.numbers(matrices.d_key);
  matrices.r = section.numbers(matrices.r_key, 9);
  const std::string key = rectifier("model");
  const std::string model = section.has(key) ? section.text(key) : "perspective";
  return make_rectifiable_camera(section, std::move(matrices),
                                 model == "perspective" ? "plumb_bob" : model, size);
}

}  // namespace

ImageSize image_size_of(const YamlSection& file, const std::string& width,
                        const std::string& height) {
  const double w = file.number(width), h = file.number(height);
  if (!(w >= 1 && w <= 65536)) file.fail(width, "impossible");
  if (!(h >= 1 && h <= 65536)) file.fail(height, "impossible");
  return {static_cast<int>(w), static_cast<int>(h)};
}

bool is_orb_pair(const YamlSection& file) {
  return file.has("Camera2.fx") || file.has("Camera.bf") || file.has("Stereo.b");
}

void read_orb_pair(const YamlSection& file, ImageSize image, PairCalibration& result) {
  const std::string type =
      file.has("Camera.type") ? file.text("Camera.type") : std::string("PinHole");
  const ImageSize size = file.has("Camera.width") && file.has("Camera.height")
                             ? image_size_of(file, "Camera.width", "Camera.height")
                             : image;
  if (!file.has("Camera2.fx")) {
    read_rectified_orb_pair(file, size, result);
    return;
  }
  if (type != "PinHole" && type != "KannalaBrandt8") {
    file.fail("Camera.type", "'" + type + "' is not supported (PinHole, KannalaBrandt8 are)");
  }
  const bool is_fisheye = type == "KannalaBrandt8";
  std::vector<double> pose = file.matrix("Stereo.T_c1_c2", 4, 4);
  pose.resize(12);
  const Rigid3d left_from_right = kitti_pose({file.line("Stereo.T_c1_c2"), pose}, result.source);
  result.raw =
      RawPair{read_orb_camera(file, "Camera1", is_fisheye, size),
              read_orb_camera(file, "Camera2", is_fisheye, size), inverse(left_from_right)};
}

bool is_stella_pair(const YamlSection& file) {
  return keys_of(file, "Camera").section.has(keys_of(file, "Camera")("focal_x_baseline"));
}

void read_stella_pair(const YamlSection& file, PairCalibration& result) {
  const Keys camera = keys_of(file, "Camera");
  const YamlSection& section = camera.section;
  const auto value = [&](const char* key) { return section.number(camera(key)); };
  if (section.has(camera("model")) && section.text(camera("model")) != "perspective") {
    section.fail(camera("model"), "'" + section.text(camera("model")) +
                                      "' is not supported of a rectified pair (perspective is)");
  }
  const ImageSize size = image_size_of(section, camera("cols"), camera("rows"));
  result.rectified =
      make_stereo_camera(value("fx"), value("fy"), value("cx"), value("cy"),
                         value("focal_x_baseline") / value("fx"), size, result.source);
  const Keys rectifier = keys_of(file, "StereoRectifier");
  if (!rectifier.section.has(rectifier("K_left"))) return;
  add_raw_pair(read_stella_camera(rectifier, "left", size),
               read_stella_camera(rectifier, "right", size), result);
}

}  // namespace hybrid_slam
