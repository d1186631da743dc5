#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace hybrid_slam {

enum class Material : std::uint8_t { kGround, kRock, kFish, kSand, kArm };

using Triangle = std::array<std::uint32_t, 3>;  // vertices, counterclockwise from outside

// Triangles in the world [m]. What the images show, and the truth of every depth.
struct TriangleMesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3f> normals;  // unit, per vertex
  std::vector<Triangle> triangles;
  std::vector<Material> materials;   // per triangle
  std::vector<std::uint32_t> seeds;  // per triangle: of its body's texture

  void append(const TriangleMesh& other);
};

// Area-weighted mean of the triangles at each vertex.
void set_vertex_normals(TriangleMesh& mesh);

// The unit sphere from an icosahedron, each triangle cut into four `levels` times.
TriangleMesh make_icosphere(int levels, Material material, std::uint32_t seed);

}  // namespace hybrid_slam
