#include "apps/io/graphs/colmap_rigs.h"

#include <fmt/format.h>

#include <algorithm>
#include <unordered_map>
#include <unordered_set>

namespace hybrid_slam {

namespace {

std::ptrdiff_t image_count(const ColmapFrame& frame) {
  return std::count_if(frame.data.begin(), frame.data.end(), [](const ColmapFrameData& data) {
    return data.sensor.type == ColmapSensor::kCamera;
  });
}

// Null if the rig has no such sensor.
const ColmapRigSensor* find_other(const ColmapRig& rig, const ColmapSensor& sensor) {
  for (const ColmapRigSensor& other : rig.others) {
    if (other.sensor == sensor) return &other;
  }
  return nullptr;
}

bool has_sensor(const ColmapRig& rig, const ColmapSensor& sensor) {
  return rig.reference == sensor || find_other(rig, sensor) != nullptr;
}

using RigsById = std::unordered_map<std::uint32_t, const ColmapRig*>;

RigsById rigs_by_id(const ColmapModel& model) {
  RigsById rigs;
  for (const ColmapRig& rig : model.rigs) {
    if (!rigs.emplace(rig.id, &rig).second) {
      throw model.error("rigs", rig.place, fmt::format("rig {} is there already", rig.id));
    }
  }
  return rigs;
}

void replace_rigs(ColmapModel& model) {
  model.rigs.clear();
  model.frames.clear();
  for (const ColmapCamera& camera : model.cameras) {
    ColmapRig rig;
    rig.id = camera.id;
    rig.reference = ColmapSensor{ColmapSensor::kCamera, camera.id};
    model.rigs.push_back(rig);
  }
  for (const ColmapImage& image : model.images) {
    ColmapFrame frame;
    frame.id = image.id;
    frame.rig = image.camera;
    frame.rig_from_world = image.cam_from_world;
    frame.data.push_back({{ColmapSensor::kCamera, image.camera}, image.id});
    model.frames.push_back(frame);
  }
}

}  // namespace

bool joins_images(const ColmapModel& model) {
  return std::any_of(model.frames.begin(), model.frames.end(),
                     [](const ColmapFrame& frame) { return image_count(frame) > 1; });
}

void check_rigs(const ColmapModel& model) {
  const RigsById rigs = rigs_by_id(model);
  std::unordered_set<std::uint32_t> frames;
  std::unordered_set<std::uint64_t> images;
  for (const ColmapFrame& frame : model.frames) {
    const auto fail = [&](const std::string& reason) {
      throw model.error("frames", frame.place, reason);
    };
    if (!frames.insert(frame.id).second) {
      fail(fmt::format("frame {} is there already", frame.id));
    }
    const auto rig = rigs.find(frame.rig);
    if (rig == rigs.end()) fail(fmt::format("there is no rig {}", frame.rig));
    for (const ColmapFrameData& data : frame.data) {
      if (!has_sensor(*rig->second, data.sensor)) {
        fail(fmt::format("rig {} has no sensor {}", frame.rig, data.sensor.id));
      }
      if (data.sensor.type == ColmapSensor::kCamera && !images.insert(data.id).second) {
        fail(fmt::format("image {} is in another frame already", data.id));
      }
    }
  }
}

void update_rigs(ColmapModel& model) {
  if (joins_images(model)) {
    replace_rigs(model);
    return;
  }
  const RigsById rigs = rigs_by_id(model);
  std::unordered_map<std::uint64_t, const ColmapImage*> images;
  for (const ColmapImage& image : model.images) images.emplace(image.id, &image);
  for (ColmapFrame& frame : model.frames) {
    for (const ColmapFrameData& data : frame.data) {
      const auto image = images.find(data.id);
      if (data.sensor.type != ColmapSensor::kCamera || image == images.end()) continue;
      frame.rig_from_world = image->second->cam_from_world;
      const ColmapRigSensor* other = find_other(*rigs.at(frame.rig), data.sensor);
      if (other != nullptr && other->sensor_from_rig) {
        frame.rig_from_world = inverse(*other->sensor_from_rig) * frame.rig_from_world;
      }
    }
  }
}

}  // namespace hybrid_slam
