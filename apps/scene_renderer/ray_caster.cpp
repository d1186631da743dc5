#include "apps/scene_renderer/ray_caster.h"

#include <embree3/rtcore.h>

#include <limits>
#include <stdexcept>
#include <string>

namespace hybrid_slam {
namespace {

constexpr float kEndless = std::numeric_limits<float>::infinity();

template <typename T, typename Item>
void copy_buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format,
                 const std::vector<Item>& items) {
  static_assert(sizeof(Item) == 3 * sizeof(T));
  T* buffer = static_cast<T*>(
      rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(Item), items.size()));
  if (buffer == nullptr) throw std::bad_alloc();
  for (const Item& item : items) {
    for (std::size_t i = 0; i < 3; ++i) *buffer++ = item.data()[i];
  }
}

RTCIntersectContext make_context(RTCIntersectContextFlags flags) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = flags;
  return context;
}

RTCRay make_ray(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float near,
                float far) {
  RTCRay ray{};
  ray.org_x = origin.x();
  ray.org_y = origin.y();
  ray.org_z = origin.z();
  ray.tnear = near;
  ray.dir_x = direction.x();
  ray.dir_y = direction.y();
  ray.dir_z = direction.z();
  ray.tfar = far;
  ray.mask = ~0U;
  return ray;
}

}  // namespace

struct RayCaster::Scene {
  explicit Scene(int threads)
      : device(rtcNewDevice(("threads=" + std::to_string(threads)).c_str())) {
    if (device == nullptr) throw std::runtime_error("Embree cannot start");
    scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);  // no gaps between neighbouring triangles
  }
  ~Scene() {
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  RTCDevice device;
  RTCScene scene = nullptr;
};

RayCaster::RayCaster(TriangleMesh mesh, int threads)
    : mesh_(std::move(mesh)), scene_(std::make_unique<Scene>(threads)) {
  RTCGeometry geometry = rtcNewGeometry(scene_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  copy_buffer<float>(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, mesh_.vertices);
  copy_buffer<unsigned>(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, mesh_.triangles);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_->scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_->scene);
  if (rtcGetDeviceError(scene_->device) != RTC_ERROR_NONE) {
    throw std::runtime_error("Embree cannot take the mesh");
  }
}

RayCaster::~RayCaster() = default;

RayHit RayCaster::hit(float distance, std::uint32_t triangle, float u, float v) const {
  const auto& [a, b, c] = mesh_.triangles[triangle];
  const Eigen::Vector3f normal =
      (1 - u - v) * mesh_.normals[a] + u * mesh_.normals[b] + v * mesh_.normals[c];
  return {distance, triangle, normal.normalized()};
}

std::array<std::optional<RayHit>, kPacket> RayCaster::cast(
    const Eigen::Vector3f& origin, const std::array<Eigen::Vector3f, kPacket>& directions) const {
  RTCIntersectContext context = make_context(RTC_INTERSECT_CONTEXT_FLAG_COHERENT);
  RTCRayHit4 rays{};
  alignas(16) const int valid[kPacket] = {-1, -1, -1, -1};
  for (int i = 0; i < kPacket; ++i) {
    const Eigen::Vector3f& direction = directions[static_cast<std::size_t>(i)];
    rays.ray.org_x[i] = origin.x();
    rays.ray.org_y[i] = origin.y();
    rays.ray.org_z[i] = origin.z();
    rays.ray.dir_x[i] = direction.x();
    rays.ray.dir_y[i] = direction.y();
    rays.ray.dir_z[i] = direction.z();
    rays.ray.tfar[i] = kEndless;
    rays.ray.mask[i] = ~0U;
    rays.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    rays.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  rtcIntersect4(valid, scene_->scene, &context, &rays);
  std::array<std::optional<RayHit>, kPacket> hits;
  for (int i = 0; i < kPacket; ++i) {
    if (rays.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
    hits[static_cast<std::size_t>(i)] =
        hit(rays.ray.tfar[i], rays.hit.primID[i], rays.hit.u[i], rays.hit.v[i]);
  }
  return hits;
}

std::optional<RayHit> RayCaster::cast(const Eigen::Vector3f& origin,
                                      const Eigen::Vector3f& direction) const {
  RTCIntersectContext context = make_context(RTC_INTERSECT_CONTEXT_FLAG_NONE);
  RTCRayHit ray{};
  ray.ray = make_ray(origin, direction, 0, kEndless);
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene_->scene, &context, &ray);
  if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return hit(ray.ray.tfar, ray.hit.primID, ray.hit.u, ray.hit.v);
}

bool RayCaster::is_blocked(const Eigen::Vector3f& from, const Eigen::Vector3f& to,
                           float margin) const {
  const Eigen::Vector3f way = to - from;
  const float length = way.norm();
  if (!(length > 2 * margin)) return false;
  RTCIntersectContext context = make_context(RTC_INTERSECT_CONTEXT_FLAG_NONE);
  RTCRay ray = make_ray(from, way / length, margin, length - margin);
  rtcOccluded1(scene_->scene, &context, &ray);
  return ray.tfar < 0;  // Embree's mark of a hit: minus infinity
}

}  // namespace hybrid_slam
