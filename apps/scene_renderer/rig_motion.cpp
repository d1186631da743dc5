#include "apps/scene_renderer/rig_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "apps/scene_renderer/noise.h"
#include "cameras/geometry/so3.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
constexpr double kHalfBaseline = 0.075;    // [m]
constexpr double kSurveyStep = 0.055;      // [m] per frame, unless the width asks for more
constexpr double kTurnSteps = 100.0 / 11;  // steps between two turns of the spiral
constexpr double kSpiralShare = 0.65;      // of the path's length; the rest are arms across
constexpr double kSurveyAltitude = 1.5;    // [m]
constexpr double kVisitShare = 0.75;       // of the radius: beyond, the first spiral has gaps
constexpr double kShakePeriod = 0.7;       // [s]
constexpr double kLeastClearance = 0.3;    // [m] of the wrist above the ground
const Vector3d kSceneMiddle(0, 0, 0.2);    // what the hovering vehicle looks at

// A smooth wandering number, about -1 to 1, that comes round in about `period` [s].
double wander(const SceneOptions& options, int stream, double period, double time) {
  Counter random(visit_seed(options), 9000 + stream);
  const auto turn = [&](double share, double pace) {
    return share * std::sin(2 * kPi * (random.uniform() + pace * time / period));
  };
  const double slow = turn(0.72, 1);
  return slow + turn(0.28, 2.3);
}

Vector3d wander3(const SceneOptions& options, int stream, double period, double time) {
  return {wander(options, stream, period, time), wander(options, stream + 1, 1.2 * period, time),
          wander(options, stream + 2, 0.85 * period, time)};
}

// Camera at `position` whose axis passes through `target`, its x axis level.
Rigid3d look_at(const Vector3d& position, const Vector3d& target, const Vector3d& up) {
  Eigen::Matrix3d axes;
  axes.col(2) = (target - position).normalized();
  axes.col(0) = axes.col(2).cross(up).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return {Eigen::Quaterniond(axes), position};
}

// The vehicle shaken by its thrusters, or by who carries it.
void shake(const SceneOptions& options, double time, Rigid3d& pose) {
  if (options.conditions.shake == 0) return;
  const double most = kPi / 180 * options.conditions.shake;
  pose.rotation() =
      (pose.rotation() * so3_exp(most * wander3(options, 30, kShakePeriod, time))).normalized();
}

// Between the cameras of the stereo pair.
Rigid3d hovering_vehicle(const SceneOptions& options, double time) {
  const Vector3d slow = wander3(options, 0, 45, time);
  const Vector3d quick = options.sway * wander3(options, 3, 9, time);
  const Vector3d position = kSceneMiddle + Vector3d(0, -1.3, 1.4) + 0.14 * slow + 0.03 * quick;
  const Vector3d turn =
      options.sway * (0.02 * wander3(options, 6, 7, time) + 0.02 * wander3(options, 9, 30, time));
  Rigid3d pose = look_at(position, kSceneMiddle, Vector3d::UnitZ());
  pose.rotation() = (pose.rotation() * so3_exp(turn)).normalized();
  shake(options, time, pose);
  return pose;
}

// A hand that works ahead of the vehicle: a survey's arm has no camera.
Rigid3d working_hand(const SceneOptions& options, const Rigid3d& world_from_vehicle, double time) {
  const Vector3d place(-0.1 + 0.2 * wander(options, 40, 11, time),
                       -0.05 + 0.1 * wander(options, 41, 13, time),
                       0.85 + 0.12 * wander(options, 42, 17, time));
  return {world_from_vehicle.rotation(), world_from_vehicle * place};
}

Rigid3d wrist_pose(const SceneOptions& options, const Rigid3d& world_from_vehicle, double time,
                   double away) {
  const Vector3d sweep(0.6 * wander(options, 12, 21, time),
                       0.1 + 0.28 * wander(options, 13, 29, time),
                       0.85 + 0.35 * wander(options, 14, 25, time));
  const Vector3d position = world_from_vehicle * sweep;
  const Vector3d target = kSceneMiddle + Vector3d(0.3 * wander(options, 15, 17, time),
                                                  0.25 + 0.3 * wander(options, 16, 23, time), -0.1);
  Rigid3d pose = look_at(position, target, Vector3d::UnitZ());
  const double roll = 0.6 * wander(options, 17, 19, time);
  const Vector3d upwards(0.86 * kPi * away, 0, 0);  // about the camera's x: into open water
  pose.rotation() =
      (pose.rotation() * so3_exp(Vector3d(0, 0, roll)) * so3_exp(upwards)).normalized();
  return pose;
}

// 0 outside, 1 in the middle of an episode that begins at `start` [s].
double episode(double time, double start, double rise, double hold, double fall) {
  const auto up = smooth_step(0, 1, static_cast<float>((time - start) / rise));
  const auto down = smooth_step(0, 1, static_cast<float>((time - start - rise - hold) / fall));
  return up * (1 - down);
}

double away_at(const SceneOptions& options, double time, double end) {
  if (!options.turned_away) return 0;
  return std::max(episode(time, 0.34 * end, 2, 2.5, 2), episode(time, 0.78 * end, 2, 2, 2));
}

double silt_strength(const SceneOptions& options, double time, double end) {
  if (!options.silt_episodes) return 0;
  return std::max(episode(time, 0.14 * end, 0.8, 2.6, 1), episode(time, 0.58 * end, 0.8, 2, 1));
}

// How much higher the whole sweep must be for the wrist to keep clear of the ground: one number
// for all frames, so that the motion stays smooth.
double lift_needed(const std::vector<RigMoment>& moments, const RayCaster& seafloor) {
  double lift = 0;
  for (const RigMoment& moment : moments) {
    const Vector3d wrist = moment.world_from_fish->translation();
    for (int i = 0; i < 17; ++i) {
      const double angle = kPi * i / 4, radius = i == 16 ? 0 : i < 8 ? 0.12 : 0.25;
      const Vector3d above =
          wrist + Vector3d(radius * std::cos(angle), radius * std::sin(angle), 9);
      const auto hit = seafloor.cast(above.cast<float>(), -Eigen::Vector3f::UnitZ());
      if (hit) lift = std::max(lift, above.z() - hit->distance + kLeastClearance - wrist.z());
    }
  }
  return lift;
}

// Way from frame to frame [m]: turns of a spiral kTurnSteps steps apart, of kSpiralShare of all
// steps, fill a circle of the given width.
double survey_step(const SceneOptions& options) {
  if (options.width <= 0) return kSurveyStep;
  return options.width / 2 * std::sqrt(kPi / (kTurnSteps * kSpiralShare * options.frames));
}

// Points of the survey's path, closer to each other than its frames.
std::vector<Eigen::Vector2d> survey_path(double radius, double step, double length) {
  constexpr double kFine = 0.01;  // [m]
  const double spacing = kTurnSteps * step;
  std::vector<Eigen::Vector2d> path;
  double angle = 0;
  const auto spiral = [&] {
    const double r = spacing * angle / (2 * kPi);
    return Eigen::Vector2d(r * std::cos(angle), r * std::sin(angle));
  };
  while (spiral().norm() < radius) {
    path.push_back(spiral());
    angle += kFine / std::max(spiral().norm(), spacing / (2 * kPi));
  }
  const auto steps = static_cast<std::size_t>(length / kFine) + 100;
  while (path.size() < steps) {
    const Eigen::Vector2d from = radius * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    for (double along = 0; along < 2; along += kFine / radius) path.push_back((1 - along) * from);
    const double turned = angle + kPi + 1.1;  // along the rim to where the next arm begins
    for (angle += kPi; angle < turned; angle += kFine / radius) {
      path.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
    }
  }
  return path;
}

// Where a visit's path lies.
struct PathPlacement {
  double radius = 0;                                // [m]
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  // [m]
  double turn = 0;                                  // [rad], before the shift
};

// Another visit's path is small enough to see nothing that the first one did not.
PathPlacement path_placement(const SceneOptions& options) {
  PathPlacement placement;
  placement.radius = survey_radius(options);
  if (options.visit == 0) return placement;
  Counter random(visit_seed(options), 8000);
  const double way = 2 * kPi * random.uniform();
  const double length = std::min<double>(random.uniform(0.2F, 0.4F), placement.radius / 4);
  placement.radius = kVisitShare * placement.radius - length;
  placement.shift = length * Eigen::Vector2d(std::cos(way), std::sin(way));
  const double turn = random.uniform(0.2F, 0.7F);
  placement.turn = random.uniform() < 0.5F ? -turn : turn;
  return placement;
}

std::vector<Eigen::Vector2d> placed_path(const SceneOptions& options, double step) {
  const auto [radius, shift, turn] = path_placement(options);
  std::vector<Eigen::Vector2d> path = survey_path(radius, step, options.frames * step);
  const Eigen::Rotation2Dd rotation(turn);
  for (Eigen::Vector2d& place : path) place = rotation * place + shift;
  return path;
}

// Where a survey's path is and which way it goes.
struct PathPoint {
  Eigen::Vector2d place, ahead;
};

PathPoint path_point(const std::vector<Eigen::Vector2d>& path, std::ptrdiff_t at) {
  const auto mean_over = [&](std::ptrdiff_t from, std::ptrdiff_t to) {
    const auto last = static_cast<std::ptrdiff_t>(path.size()) - 1;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (std::ptrdiff_t i = from; i <= to; ++i) {
      sum += path[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i, 0, last))];
    }
    return Eigen::Vector2d(sum / static_cast<double>(to - from + 1));
  };
  const Eigen::Vector2d place = mean_over(at - 20, at + 20);  // rounds the corners
  return {place, mean_over(at, at + 60) - mean_over(at - 60, at)};
}

// At `frames` frames from the beginning: at a whole number on one of the path's points, between on
// the straight line from one point to the next.
PathPoint path_point_after(const std::vector<Eigen::Vector2d>& path, double step, double frames) {
  const auto point_of = [&](double frame) { return std::lround(100 * step * frame); };
  const double nearest = std::round(frames);
  if (std::abs(frames - nearest) < 1e-9) return path_point(path, point_of(nearest));
  const double before = std::floor(frames);
  const auto from = static_cast<double>(point_of(before));
  const auto to = static_cast<double>(point_of(before + 1));
  const double exact = from + (frames - before) * (to - from);
  const auto first = static_cast<std::ptrdiff_t>(std::floor(exact));
  const double share = exact - static_cast<double>(first);
  const PathPoint a = path_point(path, first), b = path_point(path, first + 1);
  return {a.place + share * (b.place - a.place), a.ahead + share * (b.ahead - a.ahead)};
}

}  // namespace

double survey_radius(const SceneOptions& options) {
  if (options.width > 0) return options.width / 2;
  const double spiral = kSpiralShare * options.frames * kSurveyStep;
  return std::max(0.4, std::sqrt(spiral * kTurnSteps * kSurveyStep / kPi));
}

RigMotion::RigMotion(const SceneOptions& options, const RayCaster& seafloor) : options_(options) {
  if (options.kind == SceneKind::kSurvey) {
    step_ = survey_step(options);
    path_ = placed_path(options, step_);
    return;
  }
  std::vector<RigMoment> moments;
  for (int i = 0; i < options.frames; ++i) moments.push_back(hybrid_at(i / options.rate));
  lift_ = lift_needed(moments, seafloor);
}

RigMoment RigMotion::at(double time) const {
  RigMoment moment = options_.kind == SceneKind::kHybrid ? hybrid_at(time) : survey_at(time);
  moment.number = static_cast<int>(std::lround(time * options_.rate));
  return moment;
}

RigMoment RigMotion::hybrid_at(double time) const {
  const double end = options_.frames / options_.rate;
  RigMoment moment;
  moment.time = time;
  const Rigid3d vehicle = hovering_vehicle(options_, time);
  const double away = away_at(options_, time, end);
  moment.world_from_left = {vehicle.rotation(), vehicle * Vector3d(-kHalfBaseline, 0, 0)};
  Rigid3d wrist = wrist_pose(options_, vehicle, time, away);
  wrist.translation().z() += lift_;
  moment.world_from_fish = wrist;
  moment.world_from_hand = wrist;
  moment.turned_away = away > 0.5;
  moment.silt = static_cast<float>(silt_strength(options_, time, end));
  return moment;
}

RigMoment RigMotion::survey_at(double time) const {
  RigMoment moment;
  moment.time = time;
  const auto [place, ahead] = path_point_after(path_, step_, time * options_.rate);
  const Vector3d sway = options_.sway * wander3(options_, 3, 9, time);
  const Vector3d position(place.x() + 0.02 * sway.x(), place.y() + 0.02 * sway.y(),
                          kSurveyAltitude + 0.06 * sway.z());
  Rigid3d pose = look_at(position, position - Vector3d::UnitZ(), Vector3d(ahead.x(), ahead.y(), 0));
  const Vector3d turn = 0.03 * options_.sway * wander3(options_, 6, 7, time);
  pose.rotation() = (pose.rotation() * so3_exp(turn)).normalized();
  shake(options_, time, pose);
  moment.world_from_left = {pose.rotation(), pose * Vector3d(-kHalfBaseline, 0, 0)};
  moment.world_from_hand = working_hand(options_, pose, time);
  return moment;
}

std::vector<RigMoment> make_motion(const SceneOptions& options, const RayCaster& seafloor) {
  const RigMotion motion(options, seafloor);
  std::vector<RigMoment> moments;
  for (const FrameFate& fate :
       frame_fates(options.conditions, options.frames, visit_seed(options))) {
    moments.push_back(motion.at(fate.moment / options.rate));
  }
  return moments;
}

}  // namespace hybrid_slam
