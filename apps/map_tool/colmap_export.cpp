#include "apps/map_tool/colmap_export.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "apps/map_tool/map_residuals.h"

namespace hybrid_slam {
namespace {

constexpr double kFirstPixelCentre = 0.5;  // COLMAP's origin is the image's corner
constexpr std::array<std::uint8_t, 3> kGrey{128, 128, 128};

const ColmapCameraKind& kind_of(ColmapCameraModel model) {
  return *std::find_if(kColmapCameraKinds.begin(), kColmapCameraKinds.end(),
                       [&](const ColmapCameraKind& kind) { return kind.model == model; });
}

// The first parameters of one of our cameras as one of COLMAP's, whose principal point moves.
template <typename C>
ColmapCamera colmap_camera(const C& camera, ColmapCameraModel model, std::size_t principal) {
  ColmapCamera result;
  result.kind = kind_of(model);
  result.params.assign(camera.params.begin(),
                       camera.params.begin() + static_cast<std::ptrdiff_t>(result.kind.params));
  for (const std::size_t i : {principal, principal + 1}) result.params[i] += kFirstPixelCentre;
  // Where the size is not known: as if the axis went through the middle.
  const auto size = [&](int known, double centre) {
    return static_cast<std::uint64_t>(known > 0 ? known : std::max(1.0, std::round(2 * centre)));
  };
  result.width = size(camera.width, result.params[principal]);
  result.height = size(camera.height, result.params[principal + 1]);
  return result;
}

ColmapCamera to_colmap(const Calibrated<Pinhole>& c) {
  return colmap_camera(c, ColmapCameraModel::kPinhole, 2);
}
ColmapCamera to_colmap(const Calibrated<RectifiedStereo>& c) {
  return colmap_camera(c, ColmapCameraModel::kPinhole, 2);
}
ColmapCamera to_colmap(const Calibrated<KannalaBrandt>& c) {
  return colmap_camera(c, ColmapCameraModel::kOpencvFisheye, 2);
}
ColmapCamera to_colmap(const Calibrated<Radial>& c) {
  return colmap_camera(c, ColmapCameraModel::kRadial, 1);
}
ColmapCamera to_colmap(const Calibrated<Bal>&) {
  throw InputError(
      "a camera of the model bal cannot be exported: COLMAP has none that looks along -z");
}
template <typename M>
ColmapCamera to_colmap(const Calibrated<M>&) {
  throw InputError(fmt::format("a camera of the model {} cannot be exported to COLMAP", M::kName));
}

class ColmapExport {
 public:
  ColmapExport(const MapSnapshot& map, KeyframeId component, const ImageNames& names,
               ColmapLosses& losses)
      : map_(map), component_(component), names_(names), losses_(losses) {}

  ColmapModel make(ColmapVariant variant) {
    model_.variant = variant;
    model_.has_rigs = true;
    for (std::uint32_t i = 0; i < map_.camera_count(); ++i) add_camera(CameraId(i));
    for (const KeyframeId id : map_.keyframe_ids()) {
      if (map_.at(id).component == component_) add_keyframe(map_.at(id));
    }
    for (auto& [id, track] : tracks_) add_point(id, std::move(track));
    return std::move(model_);
  }

 private:
  struct Track {
    std::vector<ColmapTrackElement> elements;
    double error = 0;  // sum of distances [px]
  };

  void add_camera(CameraId id) {
    ColmapCamera camera =
        std::visit([](const auto& one) { return to_colmap(one); }, map_.camera(id));
    camera.id = static_cast<std::uint32_t>(model_.cameras.size() + 1);
    ColmapRig rig;
    rig.id = id.value + 1;
    rig.reference = ColmapSensor{ColmapSensor::kCamera, camera.id};
    first_camera_.push_back(camera.id);
    model_.cameras.push_back(camera);
    const double to_right = baseline(map_.camera(id));
    if (to_right > 0) {
      ++camera.id;
      model_.cameras.push_back(camera);
      const Rigid3d right_from_left(Eigen::Quaterniond::Identity(),
                                    Eigen::Vector3d(-to_right, 0, 0));
      rig.others.push_back({{ColmapSensor::kCamera, camera.id}, right_from_left});
    }
    model_.rigs.push_back(std::move(rig));
  }

  ColmapImage& add_image(const Keyframe& keyframe, ImageSide side, const Rigid3d& cam_from_world,
                         ColmapFrame& frame) {
    ColmapImage& image = model_.images.emplace_back();
    image.id = static_cast<std::uint32_t>(model_.images.size());
    image.camera =
        first_camera_[keyframe.observations->camera.value] + (side == ImageSide::kRight ? 1 : 0);
    image.cam_from_world = cam_from_world;
    image.name = names_.name(keyframe, side);
    frame.data.push_back({{ColmapSensor::kCamera, image.camera}, image.id});
    return image;
  }

  void add_keyframe(const Keyframe& keyframe) {
    const bool stereo = baseline(map_.camera(keyframe)) > 0;
    ColmapFrame frame;
    frame.id = static_cast<std::uint32_t>(model_.frames.size() + 1);
    frame.rig = keyframe.observations->camera.value + 1;
    frame.rig_from_world = keyframe.cam_from_world;
    add_points(keyframe, stereo ? ImageSide::kLeft : ImageSide::kSingle,
               add_image(keyframe, stereo ? ImageSide::kLeft : ImageSide::kSingle,
                         keyframe.cam_from_world, frame));
    if (stereo) {
      const Rigid3d right_from_left =
          *model_.rigs[keyframe.observations->camera.value].others.front().sensor_from_rig;
      add_points(
          keyframe, ImageSide::kRight,
          add_image(keyframe, ImageSide::kRight, right_from_left * keyframe.cam_from_world, frame));
    }
    model_.frames.push_back(std::move(frame));
  }

  void add_points(const Keyframe& keyframe, ImageSide side, ColmapImage& image) {
    const FrameObservations& seen = *keyframe.observations;
    for (std::uint32_t k = 0; k < seen.size(); ++k) {
      if (side == ImageSide::kRight && !seen.has_right(k)) continue;
      const Keypoint& keypoint = seen.features.keypoints[k];
      const double u = side == ImageSide::kRight ? seen.u_right[k] : keypoint.x;
      ColmapPoint2d point;
      point.pixel = Eigen::Vector2d(u + kFirstPixelCentre, keypoint.y + kFirstPixelCentre);
      const LandmarkId id = keyframe.landmarks[k];
      if (id.valid()) observe(keyframe, side, k, image, point);
      image.points.push_back(point);
    }
  }

  void observe(const Keyframe& keyframe, ImageSide side, std::uint32_t keypoint,
               const ColmapImage& image, ColmapPoint2d& point) {
    const LandmarkId id = keyframe.landmarks[keypoint];
    const Eigen::Vector3d in_cam = keyframe.cam_from_world * map_.at(id).point_in_world;
    const auto residual = residual_of(map_, keyframe, keypoint);
    if (!residual || !(in_cam.z() > 0)) {
      ++losses_.behind;
      return;
    }
    const Eigen::Vector3d& off = residual->pixels;
    Track& track = tracks_[id];
    track.error += std::hypot(side == ImageSide::kRight ? off[2] : off[0], off[1]);
    track.elements.push_back({image.id, static_cast<std::uint32_t>(image.points.size())});
    point.point = id.value + 1;
  }

  void add_point(LandmarkId id, Track track) {
    ColmapPoint point;
    point.id = id.value + 1;
    point.in_world = map_.at(id).point_in_world;
    point.color = kGrey;
    point.error = track.error / static_cast<double>(track.elements.size());
    point.track = std::move(track.elements);
    model_.points.push_back(std::move(point));
  }

  const MapSnapshot& map_;
  KeyframeId component_;
  const ImageNames& names_;
  ColmapLosses& losses_;
  ColmapModel model_;
  std::vector<std::uint32_t> first_camera_;  // COLMAP's id by ours: a pair's left one
  std::map<LandmarkId, Track> tracks_;
};

}  // namespace

ColmapModel make_colmap_model(const MapSnapshot& map, KeyframeId component, const ImageNames& names,
                              ColmapVariant variant, ColmapLosses& losses) {
  return ColmapExport(map, component, names, losses).make(variant);
}

}  // namespace hybrid_slam
