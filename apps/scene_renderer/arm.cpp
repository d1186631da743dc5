#include "apps/scene_renderer/arm.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "apps/scene_renderer/noise.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

// Of an arm on the right, from the vehicle's middle, along the left camera's axes [m]. The elbow is
// in view wherever the hand is.
const Vector3d kShoulder(0.3, 0.42, 0.1), kElbow(0.1, 0.2, 0.55);
constexpr double kMiddle = 0.075;  // x of the vehicle's middle in the left camera's frame
// In the fisheye's frame, behind all that it sees.
const Vector3d kWrist(0, 0, -0.16), kHousing(0, 0, -0.06);
constexpr float kWristRadius = 0.05F, kHousingRadius = 0.045F;

constexpr int kSides = 32, kCapRings = 6, kBodyRings = 16;

// One limb: a cone with round ends.
void append_limb(const Vector3d& from, float from_radius, const Vector3d& to, float to_radius,
                 int number, TriangleMesh& arm) {
  const Vector3f a = from.cast<float>(), b = to.cast<float>();
  const Vector3f axis = (b - a).normalized();
  const Vector3f u = axis.unitOrthogonal(), v = axis.cross(u);
  TriangleMesh limb;
  int rings = 0;
  const auto add_ring = [&](const Vector3f& centre, float radius) {
    for (int side = 0; side < kSides; ++side) {
      const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(side) / kSides;
      limb.vertices.push_back(centre + radius * (std::cos(angle) * u + std::sin(angle) * v));
    }
    ++rings;
  };
  const auto add_cap_ring = [&](const Vector3f& centre, float radius, int i) {
    const float angle = 0.5F * std::numbers::pi_v<float> * static_cast<float>(i) / kCapRings;
    add_ring(centre + radius * std::sin(angle) * axis, radius * std::cos(angle));
  };
  for (int i = -kCapRings; i < 0; ++i) add_cap_ring(a, from_radius, i);
  for (int i = 0; i <= kBodyRings; ++i) {
    const float share = static_cast<float>(i) / kBodyRings;
    add_ring(a + share * (b - a), from_radius + share * (to_radius - from_radius));
  }
  for (int i = 1; i <= kCapRings; ++i) add_cap_ring(b, to_radius, i);
  for (int ring = 0; ring + 1 < rings; ++ring) {
    for (int side = 0; side < kSides; ++side) {
      const auto first = static_cast<std::uint32_t>(ring * kSides);
      const std::uint32_t p = first + static_cast<std::uint32_t>(side);
      const std::uint32_t q = first + static_cast<std::uint32_t>((side + 1) % kSides);
      limb.triangles.push_back({p, q, p + kSides});
      limb.triangles.push_back({q, q + kSides, p + kSides});
      const std::uint32_t patch = mixed_bits(ring / 2, side / 4, number, 61);
      limb.seeds.insert(limb.seeds.end(), 2, patch);
    }
  }
  limb.materials.assign(limb.triangles.size(), Material::kArm);
  set_vertex_normals(limb);
  arm.append(limb);
}

}  // namespace

TriangleMesh make_arm(const RigMoment& moment, const ArmShape& shape) {
  const float thickness = shape.thickness;
  const auto joint = [&](const Vector3d& on_the_right) {
    const Vector3d mirrored(shape.side * on_the_right.x(), on_the_right.y(), on_the_right.z());
    return Vector3d(moment.world_from_left * (Vector3d(kMiddle, 0, 0) + mirrored));
  };
  const Vector3d wrist = moment.world_from_hand * kWrist;
  const Vector3d shoulder = joint(kShoulder), elbow = joint(kElbow);
  TriangleMesh arm;
  append_limb(shoulder, thickness, elbow, thickness, 0, arm);
  append_limb(elbow, thickness, wrist, kWristRadius, 1, arm);
  append_limb(wrist, kWristRadius, moment.world_from_hand * kHousing, kHousingRadius, 2, arm);
  return arm;
}

double arm_share(const RigMoment& moment, const ArmShape& shape, const ViewRays& left_rays) {
  constexpr int kColumns = 32, kRows = 24;
  const RayCaster arm(make_arm(moment, shape), 1);
  const Vector3f origin = moment.world_from_left.translation().cast<float>();
  const Eigen::Quaternionf rotation = moment.world_from_left.rotation().cast<float>();
  int seen = 0;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const int x = (2 * column + 1) * left_rays.width / (2 * kColumns);
      const int y = (2 * row + 1) * left_rays.height / (2 * kRows);
      const auto pixel = static_cast<std::size_t>(y * left_rays.width + x);
      seen += arm.cast(origin, rotation * left_rays.bearing[pixel]) ? 1 : 0;
    }
  }
  return static_cast<double>(seen) / (kColumns * kRows);
}

ArmShape fit_arm(double share, const std::vector<RigMoment>& motion, const ViewRays& left_rays) {
  constexpr std::size_t kMoments = 12;
  constexpr int kHalvings = 9;
  std::vector<RigMoment> moments;
  double side = 0;  // of the hand [m], in the sum
  for (std::size_t i = 0; i < kMoments; ++i) {
    moments.push_back(motion[i * motion.size() / kMoments]);
    const RigMoment& moment = moments.back();
    side += (inverse(moment.world_from_left) * moment.world_from_hand.translation()).x() - kMiddle;
  }
  const auto shape_of = [&](float thickness) { return ArmShape{thickness, side > 0 ? -1.0 : 1.0}; };
  float low = 0.01F, high = kThickestArm;
  for (int i = 0; i < kHalvings; ++i) {
    const float middle = 0.5F * (low + high);
    double sum = 0;
    for (const RigMoment& moment : moments) sum += arm_share(moment, shape_of(middle), left_rays);
    (sum < share * kMoments ? low : high) = middle;
  }
  return shape_of(high);
}

}  // namespace hybrid_slam
