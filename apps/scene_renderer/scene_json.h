#pragma once

#include <nlohmann/json.hpp>

#include "apps/scene_renderer/sequence.h"

namespace hybrid_slam {

// scene.json: the options, and what each frame shows (docs/datasets.md).
nlohmann::ordered_json scene_json(const SceneSequence& sequence);

// true_cameras.json: the cameras that made the images of a miscalibrated sequence.
nlohmann::ordered_json true_cameras_json(const SceneSequence& sequence);

}  // namespace hybrid_slam
