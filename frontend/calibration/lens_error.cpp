#include "frontend/calibration/lens_error.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <vector>

#include <Eigen/Cholesky>

#include "frontend/calibration/rig_calibrator.h"
#include "frontend/pose/normal_equations.h"

namespace hybrid_slam {
namespace {

constexpr double kMedianOfChi2 = 2.366;  // of 3 degrees of freedom
// Once in a million, likewise. What the optimisers' 95 % leave in the map is all to be counted: it
// is at the corners that distortion shows, and the largest residuals with it.
constexpr double kOutlierOfChi2 = 30.66;
constexpr double kAccidentalLens = 4.89;  // once in a million: standard deviations, two-sided
// Of a distortion, and of what it does to the scale, that is found, about (0.72 to 0.86 of rendered
// ones): what contradicts it most, at the corners, the map has lost as outliers.
constexpr double kShareFound = 0.75;

using Stereo = Calibrated<RectifiedStereo>;
using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// What a radial distortion moves: d(u, v, u_right) [px] / dk.
Eigen::Vector3d distortion_derivative(const Stereo& camera, const Eigen::Vector3d& pixels) {
  const auto& [fx, fy, cx, cy, baseline] = camera.params;
  const double u = (pixels[0] - cx) / fx;
  const double v = (pixels[1] - cy) / fy;
  const double u_right = (pixels[2] - cx) / fx;
  const double left = u * u + v * v;
  return {fx * left * u, fy * left * v, fx * (u_right * u_right + v * v) * u_right};
}

// An observation, linearised: of the keyframe `pose` of those that are looked at.
struct LensTerm {
  std::size_t pose = 0;
  Eigen::Matrix<double, 3, 6> d_pose;
  RowMatrix3 d_point;
  Eigen::Vector3d d_lens;
  Eigen::Vector3d residual;  // projection less measurement; all divided by the standard deviation

  double chi2() const { return residual.squaredNorm(); }
};

// The normal equations of all poses but the first and of k, the last unknown.
class LensEquations {
 public:
  explicit LensEquations(std::size_t poses)
      : information_(Eigen::MatrixXd::Zero(size_of(poses), size_of(poses))),
        gradient_(Eigen::VectorXd::Zero(size_of(poses))) {}

  // The observations of one landmark, which is eliminated.
  void add(const std::vector<LensTerm>& terms) {
    Eigen::Matrix3d point = Eigen::Matrix3d::Zero();
    Eigen::Vector3d point_gradient = Eigen::Vector3d::Zero();
    for (const LensTerm& term : terms) {
      point += term.d_point.transpose() * term.d_point;
      point_gradient += term.d_point.transpose() * term.residual;
    }
    const Eigen::LLT<Eigen::Matrix3d> factor(point);
    if (factor.info() != Eigen::Success) return;
    const Eigen::Index columns = static_cast<Eigen::Index>(6 * terms.size()) + 1;
    Eigen::MatrixXd own = Eigen::MatrixXd::Zero(columns, columns);
    Eigen::VectorXd own_gradient = Eigen::VectorXd::Zero(columns);
    Eigen::MatrixXd mixed = Eigen::MatrixXd::Zero(columns, 3);
    for (std::size_t i = 0; i < terms.size(); ++i) {
      Eigen::Matrix<double, 3, 7> d_both;
      d_both << terms[i].d_pose, terms[i].d_lens;
      const auto at = static_cast<Eigen::Index>(6 * i);
      const Eigen::Matrix<double, 7, 7> squares = d_both.transpose() * d_both;
      const Eigen::Matrix<double, 7, 1> slope = d_both.transpose() * terms[i].residual;
      const Eigen::Matrix<double, 7, 3> cross = d_both.transpose() * terms[i].d_point;
      own.block<6, 6>(at, at) += squares.topLeftCorner<6, 6>();
      own.block<6, 1>(at, columns - 1) += squares.topRightCorner<6, 1>();
      own.block<1, 6>(columns - 1, at) += squares.bottomLeftCorner<1, 6>();
      own(columns - 1, columns - 1) += squares(6, 6);
      own_gradient.segment<6>(at) += slope.head<6>();
      own_gradient[columns - 1] += slope[6];
      mixed.middleRows<6>(at) += cross.topRows<6>();
      mixed.bottomRows<1>() += cross.bottomRows<1>();
    }
    own -= mixed * factor.solve(mixed.transpose());
    own_gradient -= mixed * factor.solve(point_gradient);
    scatter(terms, own, own_gradient);
  }

  // k, its standard deviation where residuals have one of 1, and what k moves the poses by; none
  // where they are not determined.
  struct Solution {
    double distortion = 0;
    double sigma = 0;
    Eigen::VectorXd poses;
  };
  std::optional<Solution> solve() const {
    const Eigen::Index last = gradient_.size() - 1;
    const Eigen::LLT<Eigen::MatrixXd> poses(information_.topLeftCorner(last, last));
    if (last == 0 || poses.info() != Eigen::Success) return std::nullopt;
    const Eigen::VectorXd mixed = information_.col(last).head(last);
    const Eigen::VectorXd follow = poses.solve(mixed);
    const double information = information_(last, last) - mixed.dot(follow);
    if (!(information > 0)) return std::nullopt;
    const double step = -(gradient_[last] - follow.dot(gradient_.head(last))) / information;
    return Solution{step, 1 / std::sqrt(information), -step * follow};
  }

 private:
  static Eigen::Index size_of(std::size_t poses) {
    return static_cast<Eigen::Index>(6 * (poses - 1)) + 1;
  }

  void scatter(const std::vector<LensTerm>& terms, const Eigen::MatrixXd& own,
               const Eigen::VectorXd& own_gradient) {
    const Eigen::Index last = gradient_.size() - 1;
    const Eigen::Index own_last = own_gradient.size() - 1;
    information_(last, last) += own(own_last, own_last);
    gradient_[last] += own_gradient[own_last];
    for (std::size_t i = 0; i < terms.size(); ++i) {
      if (terms[i].pose == 0) continue;
      const auto row = static_cast<Eigen::Index>(6 * (terms[i].pose - 1));
      const auto own_row = static_cast<Eigen::Index>(6 * i);
      gradient_.segment<6>(row) += own_gradient.segment<6>(own_row);
      information_.block<6, 1>(row, last) += own.block<6, 1>(own_row, own_last);
      information_.block<1, 6>(last, row) += own.block<1, 6>(own_last, own_row);
      for (std::size_t j = 0; j < terms.size(); ++j) {
        if (terms[j].pose == 0) continue;
        information_.block<6, 6>(row, static_cast<Eigen::Index>(6 * (terms[j].pose - 1))) +=
            own.block<6, 6>(own_row, static_cast<Eigen::Index>(6 * j));
      }
    }
  }

  Eigen::MatrixXd information_;
  Eigen::VectorXd gradient_;
};

// The newest keyframes of the camera that hang together, oldest first.
std::vector<KeyframeId> keyframes_of_lens(const MapSnapshot& map, CameraId camera,
                                          std::size_t most) {
  std::vector<KeyframeId> ids;
  const Keyframe* const newest = map.newest_keyframe(camera);
  if (newest == nullptr) return ids;
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    if (keyframe.observations->camera == camera && keyframe.component == newest->component) {
      ids.push_back(id);
    }
  }
  if (ids.size() > most) ids.erase(ids.begin(), ids.end() - static_cast<std::ptrdiff_t>(most));
  return ids;
}

std::optional<LensTerm> term_of(const Stereo& camera, const Keyframe& keyframe,
                                std::uint32_t keypoint, const Eigen::Vector3d& point_in_world) {
  const FrameObservations& seen = *keyframe.observations;
  const Keypoint& at = seen.features.keypoints[keypoint];
  const Eigen::Vector3d in_cam = keyframe.cam_from_world * point_in_world;
  Eigen::Vector3d predicted;
  RowMatrix3 d_in_cam;
  if (!RectifiedStereo::project_with_jacobians(camera.params.data(), in_cam.data(),
                                               predicted.data(), d_in_cam.data(), nullptr)) {
    return std::nullopt;
  }
  LensTerm term;
  const bool has_right = seen.has_right(keypoint);
  const Eigen::Vector3d measured(at.x, at.y, has_right ? double{seen.u_right[keypoint]} : 0);
  const Eigen::Vector3d weight(1 / double{at.sigma}, 1 / double{at.sigma},
                               has_right ? 1 / double{at.sigma} : 0);
  term.residual = weight.cwiseProduct(predicted - measured);
  d_in_cam = weight.asDiagonal() * d_in_cam;
  term.d_pose = pose_jacobian<3>(d_in_cam, in_cam);
  term.d_point = d_in_cam * keyframe.cam_from_world.rotation().toRotationMatrix();
  term.d_lens = weight.cwiseProduct(distortion_derivative(camera, predicted));
  return term;
}

// By landmark: those that several of the keyframes see, at least one in both images.
std::vector<std::vector<LensTerm>> terms_of(const MapSnapshot& map, const Stereo& camera,
                                            const std::vector<KeyframeId>& ids) {
  std::unordered_map<std::uint32_t, std::size_t> place;
  for (std::size_t i = 0; i < ids.size(); ++i) place.emplace(ids[i].value, i);
  std::vector<std::vector<LensTerm>> landmarks;
  for (const LandmarkId id : map.landmark_ids()) {
    const Landmark& landmark = map.at(id);
    std::vector<LensTerm> terms;
    bool in_both = false;
    for (const Observation& observation : landmark.observations) {
      const auto found = place.find(observation.keyframe.value);
      if (found == place.end()) continue;
      const Keyframe& keyframe = map.at(observation.keyframe);
      auto term = term_of(camera, keyframe, observation.keypoint, landmark.point_in_world);
      if (!term) continue;
      term->pose = found->second;
      in_both = in_both || keyframe.observations->has_right(observation.keypoint);
      terms.push_back(*term);
    }
    if (in_both && terms.size() > 1) landmarks.push_back(std::move(terms));
  }
  return landmarks;
}

// Of a residual of standard deviation 1 as keypoints promise it.
double variance_of(const std::vector<std::vector<LensTerm>>& landmarks) {
  std::vector<double> chi2;
  for (const auto& terms : landmarks) {
    for (const LensTerm& term : terms) chi2.push_back(term.chi2());
  }
  if (chi2.empty()) return 0;
  const auto middle = chi2.begin() + static_cast<std::ptrdiff_t>(chi2.size() / 2);
  std::nth_element(chi2.begin(), middle, chi2.end());
  return *middle / kMedianOfChi2;
}

// Length of the way over what it is where the poses are moved.
double ratio_of_ways(const MapSnapshot& map, const std::vector<KeyframeId>& ids,
                     const Eigen::VectorXd& moved) {
  double before = 0, after = 0;
  Eigen::Vector3d last = Eigen::Vector3d::Zero(), last_moved = last;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const Rigid3d& pose = map.at(ids[i]).cam_from_world;
    const Eigen::Vector3d place = inverse(pose).translation();
    Eigen::Vector3d place_moved = place;
    if (i > 0) {
      const Vector6d step = moved.segment<6>(static_cast<Eigen::Index>(6 * (i - 1)));
      place_moved = inverse(left_perturbed(step, pose)).translation();
      before += (place - last).norm();
      after += (place_moved - last_moved).norm();
    }
    last = place;
    last_moved = place_moved;
  }
  return after > 0 ? before / after : 1;
}

}  // namespace

bool LensError::is_shown() const {
  return std::abs(distortion) > kAccidentalLens * sigma &&
         std::abs(scale - 1) > kShareFound * kDoubtfulScale;
}

std::optional<LensError> find_lens_error(const MapSnapshot& map, CameraId id, std::size_t most) {
  const auto* const camera = std::get_if<Stereo>(&map.camera(id));
  const std::vector<KeyframeId> ids = keyframes_of_lens(map, id, most);
  if (camera == nullptr || ids.size() < 2) return std::nullopt;
  std::vector<std::vector<LensTerm>> landmarks = terms_of(map, *camera, ids);
  const double variance = variance_of(landmarks);
  LensEquations equations(ids.size());
  for (auto& terms : landmarks) {
    std::erase_if(terms,
                  [&](const LensTerm& term) { return term.chi2() > kOutlierOfChi2 * variance; });
    if (terms.size() > 1) equations.add(terms);
  }
  const auto solution = equations.solve();
  if (!solution) return std::nullopt;
  const auto& [fx, fy, cx, cy, baseline] = camera->params;
  const double corner = std::pow(std::max(cx, camera->width - cx) / fx, 2) +
                        std::pow(std::max(cy, camera->height - cy) / fy, 2);
  return LensError{solution->distortion, std::sqrt(variance) * solution->sigma,
                   ratio_of_ways(map, ids, solution->poses), solution->distortion * corner};
}

}  // namespace hybrid_slam
