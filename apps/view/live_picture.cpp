#include "apps/view/live_picture.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/report/jpeg_encoder.h"
#include "apps/report/page_arrays.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kWidest = 800;  // [px]
constexpr int kQuality = 70;
constexpr double kSameMoment = 1e-4;  // [s]

GrayImage halved(const GrayImage& image) {
  GrayImage half{image.width / 2, image.height / 2, {}};
  half.pixels.resize(static_cast<std::size_t>(half.width) * static_cast<std::size_t>(half.height));
  for (int y = 0; y < half.height; ++y) {
    const std::uint8_t* const above = image.row(2 * y);
    const std::uint8_t* const below = image.row(2 * y + 1);
    std::uint8_t* const out = half.row(y);
    for (int x = 0; x < half.width; ++x) {
      const int sum = above[2 * x] + above[2 * x + 1] + below[2 * x] + below[2 * x + 1];
      out[x] = static_cast<std::uint8_t>((sum + 2) / 4);
    }
  }
  return half;
}

// The middle of pixel 0 lies at 0 in our images, in the middle of the first pixel.
double share(double pixel, int size) { return (pixel + 0.5) / size; }

std::vector<float> places(const TrackedFrame& frame, const Camera& camera, const MapSnapshot& map) {
  std::vector<float> found;
  const bool follows = frame.reference.valid() && frame.reference < map.next_keyframe_id();
  const Rigid3d cam_from_world =
      follows ? frame.cam_from_reference * map.cam_from_world(frame.reference)
              : frame.cam_from_world;
  for (const LandmarkId id : frame.counts.found) {
    const Landmark* const landmark = map.find(id);
    if (landmark == nullptr) continue;
    const auto pixel = project(camera, cam_from_world * landmark->point_in_world);
    if (!pixel || !in_image(camera, *pixel)) continue;
    found.push_back(static_cast<float>(share(pixel->x(), image_width(camera))));
    found.push_back(static_cast<float>(share(pixel->y(), image_height(camera))));
  }
  return found;
}

const Keyframe* keyframe_at(CameraKind camera, double time, const MapSnapshot& map) {
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    const bool stereo = baseline(map.camera(keyframe)) > 0;
    if (stereo == (camera == CameraKind::kStereo) &&
        std::abs(keyframe.observations->time - time) < kSameMoment) {
      return &keyframe;
    }
  }
  return nullptr;
}

Json picture_of(CameraKind camera, double time, const GrayImage& image,
                const std::vector<float>& features) {
  const std::string jpeg = encode_jpeg(image, kQuality);
  return {{"camera", camera == CameraKind::kStereo ? 0 : 1},
          {"time", time},
          {"width", image.width},
          {"height", image.height},
          {"features", page_array(features)},
          {"jpeg", base64(jpeg.data(), jpeg.size())}};
}

}  // namespace

GrayImage small_image(const GrayImage& image) {
  GrayImage small = image.width > kWidest ? halved(image) : image;
  while (small.width > kWidest) small = halved(small);
  return small;
}

Json picture_json(CameraKind camera, double time, const GrayImage& image, const TrackedFrame& frame,
                  const Camera& model, const MapSnapshot* map) {
  std::vector<float> features;
  if (map != nullptr && frame.tracked()) features = places(frame, model, *map);
  return picture_of(camera, time, image, features);
}

Json keyframe_picture_json(CameraKind camera, double time, const GrayImage& image,
                           const MapSnapshot* map) {
  const Keyframe* const keyframe = map != nullptr ? keyframe_at(camera, time, *map) : nullptr;
  std::vector<float> features;
  for (std::size_t i = 0; keyframe != nullptr && i < keyframe->landmarks.size(); ++i) {
    if (!keyframe->landmarks[i].valid()) continue;
    const Camera& model = map->camera(*keyframe);
    const Keypoint& keypoint = keyframe->observations->features.keypoints[i];
    features.push_back(static_cast<float>(share(keypoint.x, image_width(model))));
    features.push_back(static_cast<float>(share(keypoint.y, image_height(model))));
  }
  return picture_of(camera, time, image, features);
}

}  // namespace hybrid_slam
