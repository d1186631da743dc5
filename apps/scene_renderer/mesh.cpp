#include "apps/scene_renderer/mesh.h"

#include <cmath>
#include <map>
#include <utility>

#include <Eigen/Geometry>

namespace hybrid_slam {
namespace {

using EdgeMiddles = std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t>;

std::uint32_t middle_of(TriangleMesh& mesh, EdgeMiddles& middles, std::uint32_t a,
                        std::uint32_t b) {
  const auto next = static_cast<std::uint32_t>(mesh.vertices.size());
  const auto [at, is_new] = middles.emplace(std::minmax(a, b), next);
  if (is_new) {
    mesh.vertices.push_back((mesh.vertices[a] + mesh.vertices[b]).normalized());
  }
  return at->second;
}

void subdivide(TriangleMesh& mesh) {
  EdgeMiddles middles;
  std::vector<Triangle> finer;
  finer.reserve(4 * mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    const std::uint32_t ab = middle_of(mesh, middles, a, b);
    const std::uint32_t bc = middle_of(mesh, middles, b, c);
    const std::uint32_t ca = middle_of(mesh, middles, c, a);
    for (const Triangle& part :
         {Triangle{a, ab, ca}, Triangle{b, bc, ab}, Triangle{c, ca, bc}, Triangle{ab, bc, ca}}) {
      finer.push_back(part);
    }
  }
  mesh.triangles = std::move(finer);
}

}  // namespace

void TriangleMesh::append(const TriangleMesh& other) {
  const auto first = static_cast<std::uint32_t>(vertices.size());
  vertices.insert(vertices.end(), other.vertices.begin(), other.vertices.end());
  normals.insert(normals.end(), other.normals.begin(), other.normals.end());
  materials.insert(materials.end(), other.materials.begin(), other.materials.end());
  seeds.insert(seeds.end(), other.seeds.begin(), other.seeds.end());
  for (const auto& [a, b, c] : other.triangles) {
    triangles.push_back({a + first, b + first, c + first});
  }
}

void set_vertex_normals(TriangleMesh& mesh) {
  mesh.normals.assign(mesh.vertices.size(), Eigen::Vector3f::Zero());
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3f& corner = mesh.vertices[a];
    const Eigen::Vector3f area = (mesh.vertices[b] - corner).cross(mesh.vertices[c] - corner);
    for (const std::uint32_t vertex : {a, b, c}) mesh.normals[vertex] += area;
  }
  for (Eigen::Vector3f& normal : mesh.normals) normal.normalize();
}

TriangleMesh make_icosphere(int levels, Material material, std::uint32_t seed) {
  const float golden = 0.5F * (1 + std::sqrt(5.0F));
  TriangleMesh mesh;
  for (const float one : {-1.0F, 1.0F}) {
    for (const float phi : {-golden, golden}) {
      mesh.vertices.push_back(Eigen::Vector3f(0, one, phi).normalized());
      mesh.vertices.push_back(Eigen::Vector3f(one, phi, 0).normalized());
      mesh.vertices.push_back(Eigen::Vector3f(phi, 0, one).normalized());
    }
  }
  const float side = 2 / std::sqrt(1 + golden * golden);  // neighbours are this far apart
  for (std::uint32_t a = 0; a < 12; ++a) {
    for (std::uint32_t b = a + 1; b < 12; ++b) {
      for (std::uint32_t c = b + 1; c < 12; ++c) {
        const auto& va = mesh.vertices[a];
        const auto& vb = mesh.vertices[b];
        const auto& vc = mesh.vertices[c];
        const float longest = std::max({(va - vb).norm(), (vb - vc).norm(), (vc - va).norm()});
        if (longest > 1.1F * side) continue;
        const bool outward = (vb - va).cross(vc - va).dot(va) > 0;
        mesh.triangles.push_back(outward ? Triangle{a, b, c} : Triangle{a, c, b});
      }
    }
  }
  for (int level = 0; level < levels; ++level) subdivide(mesh);
  mesh.normals = mesh.vertices;
  mesh.materials.assign(mesh.triangles.size(), material);
  mesh.seeds.assign(mesh.triangles.size(), seed);
  return mesh;
}

}  // namespace hybrid_slam
