#include "apps/io/graphs/colmap_rigs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <unordered_map>
#include <unordered_set>

namespace hybrid_slam {

namespace {

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

// The pose of a sensor on its rig; none where the rig does not know it.
std::optional<Rigid3d> sensor_from_rig(const ColmapRig& rig, const ColmapSensor& sensor) {
  if (rig.reference == sensor) return Rigid3d();
  const ColmapRigSensor* other = find_other(rig, sensor);
  return other == nullptr ? std::nullopt : other->sensor_from_rig;
}

using ImagesById = std::unordered_map<std::uint64_t, std::uint32_t>;

ImagesById images_by_id(const ColmapModel& model) {
  ImagesById images;
  for (std::uint32_t i = 0; i < model.images.size(); ++i) images.emplace(model.images[i].id, i);
  return images;
}

// Calls visit(image's index, sensor_from_rig) for the images of a frame whose pose the rig knows.
template <typename Visit>
void visit_images(const ColmapFrame& frame, const RigsById& rigs, const ImagesById& images,
                  const Visit& visit) {
  for (const ColmapFrameData& data : frame.data) {
    const auto image = images.find(data.id);
    if (data.sensor.type != ColmapSensor::kCamera || image == images.end()) continue;
    if (const auto pose = sensor_from_rig(*rigs.at(frame.rig), data.sensor)) {
      visit(image->second, *pose);
    }
  }
}

// Products and squares of lengths beyond this are soon infinite.
constexpr double kFarthest = 1e100;

bool is_too_far(const Rigid3d& pose) {
  return pose.translation().lpNorm<Eigen::Infinity>() > kFarthest;
}

}  // namespace

void check_rigs(const ColmapModel& model) {
  const RigsById rigs = rigs_by_id(model);
  for (const ColmapRig& rig : model.rigs) {
    for (const ColmapRigSensor& other : rig.others) {
      if (other.sensor_from_rig && is_too_far(*other.sensor_from_rig)) {
        throw model.error("rigs", rig.place,
                          fmt::format("sensor {} is too far away to be on a rig", other.sensor.id));
      }
    }
  }
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
    if (is_too_far(frame.rig_from_world)) fail("the rig is too far away to be somewhere");
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

std::vector<std::string> apply_rigs(ColmapModel& model) {
  constexpr double kRounding = 1e-5;  // [rad], and of the length of a translation
  const RigsById rigs = rigs_by_id(model);
  const ImagesById images = images_by_id(model);
  std::size_t contradicting = 0;
  double worst_turn = 0;
  double worst_shift = 0;
  for (const ColmapFrame& frame : model.frames) {
    visit_images(frame, rigs, images, [&](std::uint32_t i, const Rigid3d& from_rig) {
      Rigid3d& pose = model.images[i].cam_from_world;
      const Rigid3d ruling = from_rig * frame.rig_from_world;
      const Rigid3d error = ruling * inverse(pose);
      const double turn = 2 * Eigen::Quaterniond(error.rotation()).vec().norm();
      const double shift = error.translation().norm();
      if (turn > kRounding || shift > kRounding * (1 + ruling.translation().norm())) {
        ++contradicting;
        worst_turn = std::max(worst_turn, 2 * std::asin(std::min(1.0, turn / 2)));
        worst_shift = std::max(worst_shift, shift);
      }
      pose = ruling;
    });
  }
  if (contradicting == 0) return {};
  return {fmt::format(
      "{}: poses of {} of {} images contradict those of {}, which rule (by up to {:.2g} degrees, "
      "{:.2g} "
      "in length)",
      model.file("images").string(), contradicting, model.images.size(),
      model.file("frames").filename().string(), worst_turn * 180 / std::numbers::pi, worst_shift)};
}

std::vector<ColmapRigidPair> rigid_pairs(const ColmapModel& model) {
  const RigsById rigs = rigs_by_id(model);
  const ImagesById images = images_by_id(model);
  std::vector<ColmapRigidPair> pairs;
  for (const ColmapFrame& frame : model.frames) {
    std::optional<ColmapRigidPair> first;
    visit_images(frame, rigs, images, [&](std::uint32_t i, const Rigid3d& from_rig) {
      if (!first) {
        first = ColmapRigidPair{i, i, from_rig};
      } else {
        pairs.push_back({first->a, i, first->a_from_b * inverse(from_rig)});
      }
    });
  }
  return pairs;
}

void update_rigs(ColmapModel& model) {
  const RigsById rigs = rigs_by_id(model);
  const ImagesById images = images_by_id(model);
  for (ColmapFrame& frame : model.frames) {
    bool is_first = true;
    visit_images(frame, rigs, images, [&](std::uint32_t i, const Rigid3d& from_rig) {
      Rigid3d& pose = model.images[i].cam_from_world;
      if (is_first) frame.rig_from_world = inverse(from_rig) * pose;
      if (!is_first) pose = from_rig * frame.rig_from_world;
      is_first = false;
    });
  }
}

}  // namespace hybrid_slam
