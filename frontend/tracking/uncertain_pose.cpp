#include "frontend/tracking/uncertain_pose.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>
#include <variant>

#include <Eigen/Cholesky>

#include "cameras/geometry/se3.h"

namespace hybrid_slam {
namespace {

using Matrix36d = Eigen::Matrix<double, 3, 6>;

// An observation, whitened, as far as its point counts: information = J^T J, J the derivative of
// the measurement by the point in the camera's frame.
struct SeenPoint {
  Eigen::Vector3d in_cam;
  Eigen::Matrix3d information;
};

// False if the point cannot be projected. `residual2`: squared, whitened; may be null.
bool see(const Camera& camera, const Eigen::Vector3d& in_cam, const Eigen::Vector3d& measurement,
         double sigma, SeenPoint& seen, double* residual2 = nullptr) {
  const auto with = [&]<ProjectionModel M>(const double* params) {
    constexpr int kDim = M::kMeasurementDim;
    double projected[kDim];
    Eigen::Matrix<double, kDim, 3, Eigen::RowMajor> by_point;
    if (!M::project_with_jacobians(params, in_cam.data(), projected, by_point.data(), nullptr)) {
      return false;
    }
    seen.in_cam = in_cam;
    seen.information.noalias() = by_point.transpose() * by_point / (sigma * sigma);
    if (residual2 != nullptr) {
      *residual2 =
          (Eigen::Map<const Eigen::Matrix<double, kDim, 1>>(projected) - measurement.head<kDim>())
              .squaredNorm() /
          (sigma * sigma);
    }
    return true;
  };
  return std::visit(
      [&](const auto& calibrated) {
        using M = typename std::decay_t<decltype(calibrated)>::Model;
        if constexpr (M::kMeasurementDim == 3) {
          if (std::isnan(measurement.z())) {
            return with.template operator()<Pinhole>(calibrated.params.data());
          }
        }
        return with.template operator()<M>(calibrated.params.data());
      },
      camera);
}

// What a left perturbation moves a point of the camera's frame by.
Matrix36d moves(const Eigen::Vector3d& in_cam) {
  Matrix36d by_pose;
  by_pose << Eigen::Matrix3d::Identity(), -hat(in_cam);
  return by_pose;
}

Eigen::Vector3d measurement_of(const FeatureSet& features, const std::vector<float>& u_right,
                               std::size_t i) {
  const Keypoint& keypoint = features.keypoints[i];
  return {keypoint.x, keypoint.y, u_right.empty() ? kNoRightMatch : u_right[i]};
}

// Sums up what a frame is off by, landmark by landmark.
class ErrorSum {
 public:
  explicit ErrorSum(const MapSnapshot& map) : map_(map) {}

  // `by_point`: the derivative of the frame's left perturbation by the landmark's place.
  void add(const Landmark& landmark, const UncertainPose::ByLandmark& by_point) {
    Eigen::Matrix3d information = look_at(landmark);
    if (sights_.empty()) return;
    const Eigen::LLT<Eigen::Matrix3d> root(information);
    // The landmark goes to the mean of where its views have it, weighted by their informations.
    const UncertainPose::ByLandmark by_gradient = root.solve(by_point.transpose()).transpose();
    for (const Sight& sight : sights_) {
      View& view = views_[sight.view];
      const UncertainPose::ByLandmark by_view =
          by_gradient * view.rotation.transpose() * sight.seen.information;
      view.by_keyframe.leftCols<3>() -= by_view;
      view.by_keyframe.rightCols<3>() += by_view * hat(sight.seen.in_cam);
      ++view.shared;
    }
    by_landmark_.emplace_back(landmark.id, root.matrixL().solve(by_point.transpose()).transpose());
  }

  void write(UncertainPose& pose) {
    std::stable_sort(views_.begin(), views_.end(),
                     [](const View& a, const View& b) { return a.shared > b.shared; });
    for (const View& view : views_) {
      pose.by_keyframe.emplace_back(view.keyframe->id, view.by_keyframe);
    }
    std::sort(by_landmark_.begin(), by_landmark_.end(),
              [](const auto& a, const auto& b) { return a.first < b.first; });
    pose.by_landmark = std::move(by_landmark_);
  }

 private:
  struct View {
    const Keyframe* keyframe;
    Eigen::Matrix3d rotation;  // cam_from_world
    Matrix6d by_keyframe = Matrix6d::Zero();
    int shared = 0;  // landmarks
  };
  struct Sight {
    std::size_t view = 0;
    SeenPoint seen;
  };

  // Fills sights_; returns the information about the landmark's place, of all together.
  Eigen::Matrix3d look_at(const Landmark& landmark) {
    sights_.clear();
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    for (const Observation& observation : landmark.observations) {
      Sight sight{view_of(observation.keyframe), {}};
      const View& view = views_[sight.view];
      const FrameObservations& frame = *view.keyframe->observations;
      const Eigen::Vector3d in_cam =
          view.rotation * landmark.point_in_world + view.keyframe->cam_from_world.translation();
      if (!see(map_.camera(frame.camera), in_cam,
               measurement_of(frame.features, frame.u_right, observation.keypoint),
               frame.features.keypoints[observation.keypoint].sigma, sight.seen)) {
        continue;
      }
      // What the views leave open, such as a distance, is off by no more than the distance.
      if (sights_.empty()) {
        sight.seen.information.diagonal().array() += 1 / in_cam.squaredNorm();
      }
      information += view.rotation.transpose() * sight.seen.information * view.rotation;
      sights_.push_back(sight);
    }
    return information;
  }

  std::size_t view_of(KeyframeId id) {
    const auto [found, is_new] = place_of_.try_emplace(id, views_.size());
    if (is_new) {
      const Keyframe& keyframe = map_.at(id);
      views_.push_back({&keyframe, keyframe.cam_from_world.rotation().toRotationMatrix()});
    }
    return found->second;
  }

  const MapSnapshot& map_;
  std::vector<View> views_;  // in the order in which landmarks name them
  std::unordered_map<KeyframeId, std::size_t> place_of_;
  std::vector<Sight> sights_;  // of the landmark at hand
  std::vector<std::pair<LandmarkId, UncertainPose::ByLandmark>> by_landmark_;
};

// An observation of the frame, and its landmark: null for one of the last frame's points.
struct FrameSight {
  SeenPoint seen;
  const Landmark* landmark;
};

// What the pose was refined on.
std::vector<FrameSight> sights_of(const MapSnapshot& map, const Camera& camera, const Frame& frame,
                                  const PoseRefinementOptions& options,
                                  std::span<const PoseObservation> others) {
  const auto threshold = [&](const Eigen::Vector3d& measurement) {
    return std::isnan(measurement.z()) ? options.chi2_mono : options.chi2_stereo;
  };
  const auto weigh = [&](const Eigen::Vector3d& measurement, SeenPoint& seen) {
    seen.information *=
        inlier_efficiency(std::isnan(measurement.z()) ? 2 : 3, threshold(measurement));
  };
  std::vector<FrameSight> sights;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    const LandmarkId id = frame.landmarks[i];
    const Landmark* landmark = id.valid() ? map.find(id) : nullptr;
    if (landmark == nullptr) continue;
    FrameSight sight{{}, landmark};
    const auto measurement = measurement_of(frame.features.left, frame.features.u_right, i);
    if (!see(camera, frame.cam_from_world * landmark->point_in_world, measurement,
             frame.features.left.keypoints[i].sigma, sight.seen)) {
      continue;
    }
    weigh(measurement, sight.seen);
    sights.push_back(sight);
  }
  for (const PoseObservation& other : others) {
    FrameSight sight{{}, nullptr};
    double residual2 = 0;
    if (!see(camera, frame.cam_from_world * other.point_in_world, other.measurement, other.sigma,
             sight.seen, &residual2) ||
        residual2 > threshold(other.measurement)) {
      continue;
    }
    weigh(other.measurement, sight.seen);
    sights.push_back(sight);
  }
  return sights;
}

// M * d, where d is what a pose is off by.
void add(const Matrix6d& times, const UncertainPose& pose, UncertainPose& sum) {
  sum.noise += times * pose.noise * times.transpose();
  for (const auto& [id, by_keyframe] : pose.by_keyframe) {
    const auto found = std::find_if(sum.by_keyframe.begin(), sum.by_keyframe.end(),
                                    [id = id](const auto& one) { return one.first == id; });
    if (found != sum.by_keyframe.end()) {
      found->second += times * by_keyframe;
    } else {
      sum.by_keyframe.emplace_back(id, times * by_keyframe);
    }
  }
  std::map<LandmarkId, UncertainPose::ByLandmark> by_landmark(sum.by_landmark.begin(),
                                                              sum.by_landmark.end());
  for (const auto& [id, by] : pose.by_landmark) {
    const auto [found, is_new] = by_landmark.try_emplace(id, UncertainPose::ByLandmark::Zero());
    found->second += times * by;
  }
  sum.by_landmark.assign(by_landmark.begin(), by_landmark.end());
}

// How certain it is against the origin: nothing is known of where another component lies.
bool is_known(const MapSnapshot& map, KeyframeId id) {
  if (id == map.origin()) return true;
  const Keyframe* const keyframe = map.find(id);
  return keyframe != nullptr && map.covariances() != nullptr &&
         keyframe->component == map.at(map.origin()).component && map.covariances()->knows(id);
}

// The keyframe that those are joined to of which the map knows nothing; invalid if there is none.
KeyframeId known_anchor(const MapSnapshot& map, const UncertainPose& pose) {
  for (const auto& [id, by_keyframe] : pose.by_keyframe) {
    if (is_known(map, id)) return id;
  }
  return {};
}

Matrix6d symmetric(const Matrix6d& m) { return 0.5 * (m + m.transpose()); }

struct PoseCovariance {
  Matrix6d covariance;
  KeyframeId base;  // against which it is
};

PoseCovariance pose_covariance(const MapSnapshot& map, const UncertainPose& pose) {
  PoseCovariance result{pose.noise, map.origin()};
  for (const auto& [id, by_landmark] : pose.by_landmark) {
    result.covariance += by_landmark * by_landmark.transpose();
  }
  const KeyframeId anchor = known_anchor(map, pose);
  if (!anchor.valid() && !pose.by_keyframe.empty()) result.base = pose.by_keyframe.front().first;
  std::vector<KeyframeCovariances::Derivative> derivatives;
  for (const auto& [id, by_keyframe] : pose.by_keyframe) {
    const bool known = is_known(map, id);
    if ((known ? id : anchor) == map.origin() || !anchor.valid()) continue;
    if (known) {
      derivatives.emplace_back(id, by_keyframe);
    } else {
      const Rigid3d id_from_anchor = map.cam_from_world(id) * inverse(map.cam_from_world(anchor));
      derivatives.emplace_back(anchor, by_keyframe * adjoint(id_from_anchor));
    }
  }
  if (!derivatives.empty()) result.covariance += map.covariances()->covariance(derivatives);
  result.covariance = symmetric(result.covariance);
  return result;
}

}  // namespace

UncertainPose UncertainPose::of_keyframe(CameraId camera, std::int64_t frame_index,
                                         KeyframeId keyframe) {
  UncertainPose pose;
  pose.camera = camera;
  pose.frame_index = frame_index;
  pose.reference = keyframe;
  if (keyframe.valid()) pose.by_keyframe.emplace_back(keyframe, Matrix6d::Identity());
  return pose;
}

UncertainPose uncertain_pose(const MapSnapshot& map, const Camera& camera, CameraId camera_id,
                             const Frame& frame, KeyframeId reference,
                             const PoseRefinementOptions& options,
                             std::span<const PoseObservation> others, const UncertainPose* last) {
  UncertainPose pose;
  pose.camera = camera_id;
  pose.frame_index = frame.index;
  pose.reference = reference;
  pose.cam_from_reference = frame.cam_from_world * inverse(map.cam_from_world(reference));
  const std::vector<FrameSight> sights = sights_of(map, camera, frame, options, others);
  Matrix6d information = Matrix6d::Zero();
  Matrix6d by_others = Matrix6d::Zero();
  for (const FrameSight& sight : sights) {
    const Matrix36d moved_by = moves(sight.seen.in_cam);
    const Matrix6d one = moved_by.transpose() * sight.seen.information * moved_by;
    information += one;
    if (sight.landmark == nullptr) by_others += one;
  }
  pose.noise = information.ldlt().solve(Matrix6d::Identity());

  const Eigen::Matrix3d rotation = frame.cam_from_world.rotation().toRotationMatrix();
  ErrorSum sum(map);
  for (const FrameSight& sight : sights) {
    if (sight.landmark == nullptr) continue;
    sum.add(*sight.landmark,
            -pose.noise * moves(sight.seen.in_cam).transpose() * sight.seen.information * rotation);
  }
  sum.write(pose);
  if (last != nullptr && by_others.diagonal().maxCoeff() > 0) {
    const Rigid3d last_from_world = last->cam_from_reference * map.cam_from_world(last->reference);
    add(pose.noise * by_others * adjoint(frame.cam_from_world * inverse(last_from_world)), *last,
        pose);
  }
  pose.noise = symmetric(pose.noise);
  return pose;
}

UncertainPose moved(const UncertainPose& pose, const UncertainMotion& motion,
                    std::int64_t frame_index) {
  UncertainPose result;
  result.camera = pose.camera;
  result.frame_index = frame_index;
  result.reference = pose.reference;
  result.cam_from_reference = motion.b_from_a * pose.cam_from_reference;
  add(adjoint(motion.b_from_a), pose, result);
  result.noise = symmetric(result.noise + motion.covariance);
  return result;
}

UncertainPose present(const MapSnapshot& map, const UncertainPose& pose) {
  const Keyframe* keyframe = map.find_frame(pose.camera, pose.frame_index);
  return keyframe == nullptr
             ? pose
             : UncertainPose::of_keyframe(pose.camera, pose.frame_index, keyframe->id);
}

void write_covariance(const MapSnapshot& map, const UncertainPose& pose, TrackedFrame& frame) {
  const PoseCovariance found = pose_covariance(map, pose);
  frame.covariance = found.covariance;
  frame.covariance_base = found.base;
}

// exp(d_a) A (exp(d_b) B)^-1 = exp(d_a - adjoint(A B^-1) d_b) A B^-1, to first order.
UncertainMotion relative_pose(const MapSnapshot& map, const UncertainPose& given_a,
                              const UncertainPose& given_b) {
  const UncertainPose a = present(map, given_a);
  const UncertainPose b = present(map, given_b);
  const auto pose_of = [&](const UncertainPose& one) {
    return one.cam_from_reference * map.cam_from_world(one.reference);
  };
  UncertainMotion result{pose_of(a) * inverse(pose_of(b))};
  const Matrix6d by_b = -adjoint(result.b_from_a);
  UncertainPose difference = a;
  add(by_b, b, difference);
  result.covariance = pose_covariance(map, difference).covariance;
  return result;
}

}  // namespace hybrid_slam
