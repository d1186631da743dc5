#include "test/support/synthetic_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "test/support/random.h"

namespace hybrid_slam {

namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kSeafloorDepth = 3;
constexpr double kOrbitRadius = 3;
constexpr double kSmallestScale = 0.8;  // [px] detectable
constexpr double kLargestScale = 30;

bool is_corridor(const SyntheticSceneOptions& options) {
  return options.trajectory == SceneTrajectory::kCorridor;
}

double step_length(const SyntheticSceneOptions& options) {
  if (options.step > 0) return options.step;
  switch (options.trajectory) {
    case SceneTrajectory::kCorridor:
      return 0.4;
    case SceneTrajectory::kHover:
      return 0.02;
    case SceneTrajectory::kOrbit:
      break;
  }
  return 2 * kPi * kOrbitRadius / options.times;
}

Rigid3d pose(const Eigen::Vector3d& position, double yaw, double pitch, double roll) {
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()));
  return {rotation, position};
}

// World axes of the generator: those of a camera at the start; the seafloor lies towards +z.
Rigid3d world_from_stereo(const SyntheticSceneOptions& options, int time) {
  const double way = time * step_length(options);
  const double t = time * 0.3;
  switch (options.trajectory) {
    case SceneTrajectory::kCorridor:
      return pose({0.3 * std::sin(0.1 * way), 0.05 * std::sin(0.2 * way), way},
                  0.05 * std::sin(0.1 * way), 0.01 * std::sin(t), 0.01 * std::sin(1.3 * t));
    case SceneTrajectory::kHover:
      return pose({way, 0.1 * std::sin(t), 0.08 * std::sin(0.7 * t)}, 0.05 * std::sin(t),
                  0.05 * std::sin(0.6 * t), 0.05 * std::sin(0.8 * t));
    case SceneTrajectory::kOrbit:
      break;
  }
  const double angle = way / kOrbitRadius;
  return pose(
      {kOrbitRadius * std::cos(angle), kOrbitRadius * std::sin(angle), 0.15 * std::sin(2 * angle)},
      0.05 * std::sin(3 * angle), 0.05 * std::sin(2 * angle), angle);
}

// The wrist: about a metre ahead of the pair (nearer to the seafloor), swinging on its own.
Rigid3d stereo_from_fisheye(int time) {
  const double t = time * 0.37;
  return pose({0.3 + 0.2 * std::sin(t), 0.2 * std::cos(0.8 * t), 1 + 0.2 * std::sin(0.5 * t)},
              0.3 * std::sin(0.9 * t), 0.3 * std::cos(0.7 * t), 0.4 * std::sin(0.4 * t));
}

Eigen::Vector3d corridor_point(double length, Random& random) {
  const double z = random.uniform(2, length + 30);
  if (random.uniform() < 0.3) return {random.uniform(-6, 6), 1.6, z};
  const double side = random.uniform() < 0.5 ? -1 : 1;
  return {side * random.uniform(5, 7), random.uniform(-4, 1.6), z};
}

Eigen::Vector3d seafloor_point(double half_width, double half_height, Random& random) {
  const double x = random.uniform(-half_width, half_width);
  const double y = random.uniform(-half_height, half_height);
  const double relief = 0.4 * std::sin(1.1 * x) * std::cos(0.9 * y) + 0.15 * std::sin(4 * x + y);
  return {x, y, kSeafloorDepth + relief + random.uniform(-0.1, 0.1)};
}

Eigen::Vector3d landmark_point(const SyntheticSceneOptions& options, Random& random) {
  const double length = step_length(options) * options.times;
  switch (options.trajectory) {
    case SceneTrajectory::kCorridor:
      return corridor_point(length, random);
    case SceneTrajectory::kHover:
      return seafloor_point(2.5 + length, 2, random);
    case SceneTrajectory::kOrbit:
      break;
  }
  return seafloor_point(kOrbitRadius + 2, kOrbitRadius + 2, random);
}

// Root of a histogram of exponentially distributed bins: two of them are about 1.0 apart.
Descriptor random_descriptor(Random& random) {
  Eigen::Matrix<double, 128, 1> bins;
  for (double& bin : bins) bin = -std::log(1 - random.uniform());
  bins *= 512 / bins.norm();
  Descriptor descriptor;
  for (std::size_t i = 0; i < descriptor.size(); ++i) {
    descriptor[i] = static_cast<std::uint8_t>(std::min(255., bins[static_cast<int>(i)]));
  }
  return descriptor;
}

Descriptor noisy(const Descriptor& descriptor, double sigma, Random& random) {
  Descriptor result;
  for (std::size_t i = 0; i < result.size(); ++i) {
    const double value = std::round(descriptor[i] + sigma * random.gaussian());
    result[i] = static_cast<std::uint8_t>(std::clamp(value, 0., 255.));
  }
  return result;
}

// One keypoint and its truth, before the order is shuffled.
struct Seen {
  Keypoint keypoint;
  Descriptor descriptor{};
  float u_right = kNoRightMatch;
  int landmark = -1;
  bool outlier = false;
};

// What one camera sees from one place.
class FrameMaker {
 public:
  FrameMaker(const SyntheticScene& scene, const std::vector<double>& sizes, Random& random)
      : scene_(scene), sizes_(sizes), random_(random) {}

  SyntheticFrame make(CameraId camera, int time, const Rigid3d& cam_from_world) {
    camera_ = &scene_.cameras[camera.value];
    std::vector<Seen> seen;
    for (std::size_t i = 0; i < scene_.points_in_world.size(); ++i) {
      see_landmark(i, cam_from_world * scene_.points_in_world[i], seen);
    }
    for (int i = 0; i < scene_.options.clutter; ++i) see_clutter(seen);
    for (std::size_t i = seen.size(); i > 1; --i) std::swap(seen[i - 1], seen[random_.below(i)]);
    return collect(seen, camera, time, cam_from_world);
  }

 private:
  bool is_stereo() const { return baseline(*camera_) > 0; }

  Eigen::Vector2d random_pixel() {
    const double u = random_.uniform(0, image_width(*camera_) - 1);
    return {u, random_.uniform(0, image_height(*camera_) - 1)};
  }

  void see_landmark(std::size_t index, const Eigen::Vector3d& point_in_cam,
                    std::vector<Seen>& seen) {
    const auto pixel = project(*camera_, point_in_cam);
    if (!pixel || !in_image(*camera_, *pixel)) return;
    const double scale = focal_length(*camera_) * sizes_[index] / point_in_cam.norm();
    if (scale < kSmallestScale || scale > kLargestScale) return;
    Seen s;
    s.landmark = static_cast<int>(index);
    s.descriptor = noisy(scene_.descriptors[index], scene_.options.descriptor_noise, random_);
    set_keypoint(s.keypoint, *pixel, scale);
    const double sigma = s.keypoint.sigma;
    s.keypoint.x += static_cast<float>(sigma * random_.gaussian());
    s.keypoint.y += static_cast<float>(sigma * random_.gaussian());
    const auto stereo = project_stereo(*camera_, point_in_cam);
    if (stereo && random_.uniform() >= scene_.options.missing_right_rate) {
      const double u_right = (*stereo)[2] + sigma * random_.gaussian();
      if (u_right >= 0 && s.keypoint.x - u_right > 0.1) s.u_right = static_cast<float>(u_right);
    }
    if (random_.uniform() < scene_.options.outlier_rate) make_wrong(s, *pixel);
    if (in_image(*camera_, {s.keypoint.x, s.keypoint.y})) seen.push_back(s);
  }

  // Elsewhere in the image, at least 15 standard deviations from where it belongs.
  void make_wrong(Seen& s, const Eigen::Vector2d& right_place) {
    s.outlier = true;
    Eigen::Vector2d place = random_pixel();
    while ((place - right_place).norm() < 15 * s.keypoint.sigma + 10) place = random_pixel();
    if (!std::isnan(s.u_right)) s.u_right += static_cast<float>(place.x()) - s.keypoint.x;
    s.keypoint.x = static_cast<float>(place.x());
    s.keypoint.y = static_cast<float>(place.y());
  }

  void see_clutter(std::vector<Seen>& seen) {
    Seen s;
    set_keypoint(s.keypoint, random_pixel(), random_.uniform(1.6, 6));
    s.descriptor = random_descriptor(random_);
    seen.push_back(s);
  }

  void set_keypoint(Keypoint& keypoint, const Eigen::Vector2d& pixel, double scale) {
    keypoint.x = static_cast<float>(pixel.x());
    keypoint.y = static_cast<float>(pixel.y());
    keypoint.scale = static_cast<float>(scale);
    keypoint.response = static_cast<float>(random_.uniform(1.2, 30));
    keypoint.sigma = static_cast<float>(std::max(0.05, scene_.options.noise * scale));
  }

  SyntheticFrame collect(const std::vector<Seen>& seen, CameraId camera, int time,
                         const Rigid3d& cam_from_world) const {
    auto observations = std::make_shared<FrameObservations>();
    SyntheticFrame frame;
    frame.cam_from_world = cam_from_world;
    observations->camera = camera;
    observations->frame_index = time;
    observations->time = time / scene_.options.frame_rate;
    observations->features.kind = DescriptorKind::kSynthetic;
    for (const Seen& s : seen) {
      observations->features.keypoints.push_back(s.keypoint);
      observations->features.descriptors.push_back(s.descriptor);
      if (is_stereo()) observations->u_right.push_back(s.u_right);
      frame.landmark.push_back(s.landmark);
      frame.outlier.push_back(s.outlier ? 1 : 0);
    }
    frame.observations = std::move(observations);
    return frame;
  }

  const SyntheticScene& scene_;
  const std::vector<double>& sizes_;
  Random& random_;
  const Camera* camera_ = nullptr;
};

}  // namespace

Calibrated<RectifiedStereo> synthetic_stereo_camera(double baseline) {
  return {{450, 450, 319.5, 239.5, baseline}, 640, 480};
}

Calibrated<KannalaBrandt> synthetic_fisheye_camera() {
  return {{240, 240, 399.5, 399.5, 0.02, -0.008, 0.002, -0.0005}, 800, 800};
}

SyntheticScene make_synthetic_scene(const SyntheticSceneOptions& options) {
  SyntheticScene scene;
  scene.options = options;
  if (options.stereo)
    scene.cameras.push_back(synthetic_stereo_camera(is_corridor(options) ? 0.5 : 0.12));
  if (options.fisheye) scene.cameras.push_back(synthetic_fisheye_camera());

  const auto generator_from_cam = [&](int time, bool fisheye) {
    const Rigid3d stereo = world_from_stereo(options, time);
    return fisheye ? stereo * stereo_from_fisheye(time) : stereo;
  };
  const Rigid3d world_from_generator = inverse(generator_from_cam(0, !options.stereo));
  Random random(options.seed);
  std::vector<double> sizes;
  const double usual_distance = is_corridor(options) ? 12 : kSeafloorDepth;
  for (int i = 0; i < options.landmarks; ++i) {
    scene.points_in_world.push_back(world_from_generator * landmark_point(options, random));
    scene.descriptors.push_back(random_descriptor(random));
    const double scale = 1.6 * std::pow(5, random.uniform());
    sizes.push_back(scale * usual_distance / 450);
  }

  FrameMaker maker(scene, sizes, random);
  for (int time = 0; time < options.times; ++time) {
    std::uint32_t camera = 0;
    for (const bool fisheye : {false, true}) {
      if (fisheye ? !options.fisheye : !options.stereo) continue;
      const Rigid3d cam_from_world =
          inverse(world_from_generator * generator_from_cam(time, fisheye));
      scene.frames.push_back(maker.make(CameraId(camera++), time, cam_from_world));
    }
  }
  return scene;
}

}  // namespace hybrid_slam
