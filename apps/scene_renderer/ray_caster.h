#pragma once

#include <array>
#include <memory>
#include <optional>

#include <Eigen/Core>

#include "apps/scene_renderer/mesh.h"

namespace hybrid_slam {

// Where a ray first meets a mesh.
struct RayHit {
  float distance = 0;  // along the unit direction [m]
  std::uint32_t triangle = 0;
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // unit, interpolated between vertices
};

inline constexpr int kPacket = 4;  // rays cast together

// Intersects rays with a mesh, exactly as its triangles lie (Embree). Immutable and thread-safe.
class RayCaster {
 public:
  // Keeps the mesh. `threads`: to build with. Throws std::runtime_error if Embree cannot start.
  RayCaster(TriangleMesh mesh, int threads);
  ~RayCaster();
  RayCaster(const RayCaster&) = delete;
  RayCaster& operator=(const RayCaster&) = delete;

  // Nearest hits of rays from one origin along unit directions.
  std::array<std::optional<RayHit>, kPacket> cast(
      const Eigen::Vector3f& origin, const std::array<Eigen::Vector3f, kPacket>& directions) const;
  std::optional<RayHit> cast(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) const;

  // Whether anything lies between two points, leaving out `margin` [m] at either end.
  bool is_blocked(const Eigen::Vector3f& from, const Eigen::Vector3f& to, float margin) const;

  const TriangleMesh& mesh() const { return mesh_; }

 private:
  struct Scene;

  RayHit hit(float distance, std::uint32_t triangle, float u, float v) const;

  const TriangleMesh mesh_;
  std::unique_ptr<Scene> scene_;
};

}  // namespace hybrid_slam
