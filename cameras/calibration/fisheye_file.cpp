#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "cameras/calibration/calibration_file.h"
#include "cameras/calibration/calibration_section.h"

namespace hybrid_slam {
namespace {

using FisheyeParams = std::array<double, KannalaBrandt::kParamCount>;

FisheyeParams read_named_params(const YamlSection& file, const std::string& prefix) {
  FisheyeParams params;
  const char* const names[] = {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};
  for (std::size_t i = 0; i < params.size(); ++i) params[i] = file.number(prefix + names[i]);
  return params;
}

// The model has no skew; how far that moves the image's border is said, if it can be seen at all.
void check_matrix(const YamlSection& file, const std::string& key, const std::vector<double>& k,
                  std::vector<std::string>& notes) {
  if (k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1) {
    file.fail(key, "must be (fx 0 cx; 0 fy cy; 0 0 1)");
  }
  constexpr double kVisible = 0.05;  // [px], the noise of good features
  constexpr double kTooMuch = 5;     // [px]
  const double shift = std::abs(k[1]) * std::max(k[5] / k[4], 1.0);  // the border is 2 cy high
  if (shift <= kVisible) return;
  char text[120];
  std::snprintf(text, sizeof(text),
                "the skew of %.4g px is left out; it moves the border by %.2g px", k[1], shift);
  if (shift > kTooMuch) file.fail(key, std::string(text) + ", too much for this model");
  notes.push_back(key + ": " + text);
}

// The fields of a CameraInfo message: k (9) and d.
FisheyeParams read_message_params(const YamlSection& file, const std::string& k_key,
                                  std::vector<std::string>& notes) {
  const std::vector<double> k = file.numbers(k_key, 9);
  check_matrix(file, k_key, k, notes);
  const std::string d_key = file.has("D") ? "D" : "d";
  const std::vector<double> d = file.numbers(d_key);
  if (d.size() != 4) file.fail(d_key, "a fisheye has 4 of them");
  return {k[0], k[4], k[2], k[5], d[0], d[1], d[2], d[3]};
}

FisheyeParams read_matrix_params(const YamlSection& file, std::vector<std::string>& notes) {
  const std::vector<double> k = file.matrix("camera_matrix", 3, 3);
  check_matrix(file, "camera_matrix", k, notes);
  const YamlSection d_matrix = file.child("distortion_coefficients");
  if (d_matrix.number("rows") * d_matrix.number("cols") != 4) {
    file.fail("distortion_coefficients", "a fisheye has 4 of them");
  }
  const std::vector<double> d = d_matrix.numbers("data", 4);
  return {k[0], k[4], k[2], k[5], d[0], d[1], d[2], d[3]};
}

void check_fisheye_words(const YamlSection& file) {
  constexpr std::array kFisheyeWords{"equidistant", "fisheye", "KannalaBrandt8", "kannala_brandt",
                                     "kb4"};
  for (const char* key : {"distortion_model", "Camera.type", "Camera.model"}) {
    if (!file.has(key)) continue;
    const std::string model = file.text(key);
    if (std::find(kFisheyeWords.begin(), kFisheyeWords.end(), model) == kFisheyeWords.end()) {
      file.fail(key, "'" + model + "' is no fisheye (equidistant is)");
    }
  }
}

// Files that say the numbers themselves, once or several times.
FisheyeLens read_plain_fisheye(const YamlSection& file, std::vector<std::string>& notes) {
  check_fisheye_words(file);
  std::vector<std::pair<std::string, FisheyeParams>> found;
  for (const std::string prefix : {"", "Camera.", "Camera1."}) {
    if (file.has(prefix + "fx")) {
      found.emplace_back(prefix + "fx", read_named_params(file, prefix));
    }
  }
  for (const std::string key : {"k", "K"}) {
    if (file.has(key)) found.emplace_back(key, read_message_params(file, key, notes));
  }
  if (file.has("camera_matrix")) {
    found.emplace_back("camera_matrix", read_matrix_params(file, notes));
  }
  if (found.empty()) file.fail("fx", "neither it nor cam0 nor camera_matrix is there");
  for (const auto& [key, params] : found) {
    for (std::size_t i = 0; i < params.size(); ++i) {
      if (std::abs(params[i] - found[0].second[i]) > 1e-9 * (1 + std::abs(params[i]))) {
        file.fail(key, "contradicts " + found[0].first);
      }
    }
  }
  if (file.has("Camera2.fx")) notes.push_back("Camera1 and Camera2 are lenses; took Camera1");

  FisheyeLens lens{{found[0].second, 0, 0}, ""};
  using Key = const char*;
  for (const auto& [width, height] : {std::pair<Key, Key>("image_width", "image_height"),
                                      {"Camera.width", "Camera.height"},
                                      {"Camera.cols", "Camera.rows"},
                                      {"cols", "rows"},
                                      {"width", "height"}}) {
    if (!file.has(width)) continue;
    lens.camera.width = image_size(file, width, file.number(width));
    lens.camera.height = image_size(file, height, file.number(height));
  }
  check_intrinsics(file, lens.camera.params.data(), lens.camera.width, lens.camera.height,
                   found[0].first);
  return lens;
}

// The name of the section that is called a fisheye; empty if there is none.
std::string fisheye_section(const YamlSection& file) {
  for (const std::string& key : file.keys()) {
    if (key.find("fish") != std::string::npos && file.has_section(key) &&
        file.child(key).has("intrinsics")) {
      return key;
    }
  }
  return {};
}

// What the section called a fisheye says, beside which there may be a chain: the authors of UWslam
// publish the camera after undistortion as cam0 and the lens as a section "fisheye".
FisheyeLens read_section_fisheye(const YamlSection& file, const std::string& key,
                                 std::vector<std::string>& notes) {
  const YamlSection section = file.child(key);
  const auto lens = read_kalibr_lens(section);
  if (!lens) section.fail("distortion_model", "is not that of a fisheye (equidistant is)");
  if (file.has("cam0")) notes.push_back("took the section " + key + " for the lens, not cam0");
  return *lens;
}

}  // namespace

Calibrated<KannalaBrandt> read_fisheye(const std::string& path,
                                       std::vector<std::string>* warnings) {
  const YamlSection file = YamlSection::read(path);
  std::vector<std::string> notes;
  FisheyeLens lens;
  if (const std::string key = fisheye_section(file); !key.empty()) {
    lens = read_section_fisheye(file, key, notes);
  } else if (file.has("cam0")) {
    lens = read_chain_fisheye(file, notes);
  } else if (file.has("value0")) {
    lens = read_basalt_lens(file);
  } else if (file.has_section("Camera")) {  // stella_vslam
    const YamlSection camera = file.child("Camera");
    if (camera.has("model") && camera.text("model") != "fisheye") {
      camera.fail("model", "'" + camera.text("model") + "' is no fisheye (fisheye is)");
    }
    lens = read_plain_fisheye(camera, notes);
  } else {
    lens = read_plain_fisheye(file, notes);
  }
  if (!lens.note.empty()) notes.push_back(lens.note);
  if (warnings != nullptr) {
    for (const std::string& note : notes) warnings->push_back(path + ": " + note);
  }
  return lens.camera;
}

}  // namespace hybrid_slam
