#pragma once

#include <nlohmann/json_fwd.hpp>

#include "apps/slam/inputs.h"
#include "backend/map/map_snapshot.h"
#include "frontend/tracking/tracked_frame.h"

namespace hybrid_slam {

// The image, its sides halved until it is at most 800 px wide: each pixel is the mean of four.
GrayImage small_image(const GrayImage& image);

// The event "picture" of a frame: `image`, as small_image() made it, as JPEG in base64; and where
// in it, as shares of width and height, the landmarks lie that the frame found ("features": x y x y
// ...): projected by its pose, both as `map` has them now. Without a map there are none.
nlohmann::ordered_json picture_json(CameraKind camera, double time, const GrayImage& image,
                                    const TrackedFrame& frame, const Camera& model,
                                    const MapSnapshot* map);

// The same of a finished run: the features are those of the keyframe of that time, where there is
// one, that became landmarks.
nlohmann::ordered_json keyframe_picture_json(CameraKind camera, double time, const GrayImage& image,
                                             const MapSnapshot* map);

}  // namespace hybrid_slam
