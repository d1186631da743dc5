#pragma once

#include "apps/io/graphs/colmap_model.h"

namespace hybrid_slam {

// Throws InputError unless ids are unique, frames name a rig and its sensors, and every image is in
// at most one frame.
void check_rigs(const ColmapModel& model);

// Takes the images' poses from the frames and rigs, which rule, as in COLMAP from 3.12 on: what
// images.txt says may be stale. Returns a warning if it contradicts them. The rigs must be checked.
std::vector<std::string> apply_rigs(ColmapModel& model);

// Two images of one frame, by their index: their relative pose is the rig's.
struct ColmapRigidPair {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  Rigid3d a_from_b;
};

// The first image of each frame with each other one.
std::vector<ColmapRigidPair> rigid_pairs(const ColmapModel& model);

// Makes the frames' poses follow that of their first image, and the other images follow these.
void update_rigs(ColmapModel& model);

}  // namespace hybrid_slam
