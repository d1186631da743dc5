#include "apps/scene_renderer/lamps.h"

#include "apps/scene_renderer/noise.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector3d;

// How a lamp is mounted, in its body's frame.
struct Mounting {
  Vector3d place, towards;  // [m]
  float power, beam;
  Color color{1.0F, 0.97F, 0.88F};
};

// As another visit finds it: moved up to `reach` [m] along each axis, still aimed at the same
// place.
void change(const SceneOptions& options, int number, double reach, Mounting& lamp) {
  if (options.visit == 0) return;
  Counter random(visit_seed(options), 7000 + number);
  const auto either_way = [&] { return 2 * random.uniform() - 1; };
  for (double& coordinate : lamp.place) coordinate += reach * either_way();
  lamp.power *= 1 + 0.3F * either_way();
  for (float& channel : lamp.color) channel *= 1 + 0.06F * either_way();
}

Lamp mounted(const Rigid3d& world_from_body, const Mounting& mounting) {
  Lamp lamp;
  const Vector3d ahead = (mounting.towards - mounting.place).normalized();
  lamp.position = (world_from_body * mounting.place).cast<float>();
  lamp.axis = (world_from_body.rotation() * ahead).cast<float>();
  lamp.intensity = mounting.power * mounting.color;
  lamp.beam = mounting.beam;
  return lamp;
}

}  // namespace

std::vector<Lamp> lamps_at(const SceneOptions& options, const RigMoment& moment) {
  const Vector3d ahead(0.075, 0, 1.9);  // in the left camera's frame
  Mounting left{{-0.38, -0.2, -0.05}, ahead, 3.2F, 2}, right{{0.53, -0.22, -0.05}, ahead, 2.6F, 2};
  change(options, 0, 0.11, left);
  change(options, 1, 0.11, right);
  std::vector<Lamp> lamps{mounted(moment.world_from_left, left),
                          mounted(moment.world_from_left, right)};
  if (moment.world_from_fish) {
    const Vector3d beside(0.02, -0.08, 0.01);
    Mounting wrist{beside, beside + Vector3d(0, 0.05, 1), 0.35F, 0.9F};
    change(options, 2, 0.025, wrist);
    lamps.push_back(mounted(*moment.world_from_fish, wrist));
  }
  return lamps;
}

}  // namespace hybrid_slam
