#pragma once

#include "apps/io/graphs/colmap_model.h"

namespace hybrid_slam {

// Whether a frame of the model holds more than one image: their poses then depend on each other.
bool joins_images(const ColmapModel& model);

// Throws InputError unless ids are unique, frames name a rig and its sensors, and every image is in
// at most one frame.
void check_rigs(const ColmapModel& model);

// Makes the frames' poses follow the images' poses. Where a frame joins several images, rigs and
// frames are replaced: a rig per camera, a frame per image.
void update_rigs(ColmapModel& model);

}  // namespace hybrid_slam
