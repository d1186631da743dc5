#include "frontend/mapping/epipolar_band.h"

#include <bit>
#include <limits>

// Compiled once per instruction set; the best one that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frontend/mapping/epipolar_band.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hybrid_slam {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// (normal . bearing)^2 <= factor * variance + own.
std::size_t rays_near_plane(const float* const* rays, std::size_t count, const float* normal,
                            float factor, float own, std::uint32_t* found) {
  const hn::CappedTag<float, 16> d;
  const auto nx = hn::Set(d, normal[0]);
  const auto ny = hn::Set(d, normal[1]);
  const auto nz = hn::Set(d, normal[2]);
  std::size_t n = 0;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    auto off = hn::Mul(nx, hn::LoadU(d, rays[0] + i));
    off = hn::MulAdd(ny, hn::LoadU(d, rays[1] + i), off);
    off = hn::MulAdd(nz, hn::LoadU(d, rays[2] + i), off);
    const auto band = hn::MulAdd(hn::Set(d, factor), hn::LoadU(d, rays[3] + i), hn::Set(d, own));
    const auto near = hn::Le(hn::Mul(off, off), band);
    if (hn::AllFalse(d, near)) continue;
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, near, bytes);
    for (std::uint32_t bits = bytes[0] | bytes[1] << 8; bits != 0; bits &= bits - 1) {
      found[n++] =
          static_cast<std::uint32_t>(i) + static_cast<std::uint32_t>(std::countr_zero(bits));
    }
  }
  return n;
}

}  // namespace HWY_NAMESPACE
}  // namespace hybrid_slam
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hybrid_slam {

HWY_EXPORT(rays_near_plane);

namespace {
constexpr std::size_t kPadding = 16;  // floats of the widest vector

// A product of unit vectors is off by 3e-7 at most, and so its square by 1e-10 and less than 1 % of
// what it is beside that.
constexpr double kRelative = 1.01;
constexpr double kAbsolute = 1e-10;
}  // namespace

void EpipolarBand::add(const Eigen::Vector3d& bearing, double variance) {
  if (size_ % kPadding == 0) {
    for (std::vector<float>* one : {&x_, &y_, &z_}) one->resize(size_ + kPadding, 0);
    variance_.resize(size_ + kPadding, -std::numeric_limits<float>::infinity());
  }
  x_[size_] = static_cast<float>(bearing.x());
  y_[size_] = static_cast<float>(bearing.y());
  z_[size_] = static_cast<float>(bearing.z());
  variance_[size_++] = static_cast<float>(variance);
}

void EpipolarBand::find(const Eigen::Vector3d& normal, double variance, double factor,
                        std::vector<std::uint32_t>& found) const {
  const float* rays[] = {x_.data(), y_.data(), z_.data(), variance_.data()};
  const Eigen::Vector3f rounded = normal.cast<float>();
  found.resize(x_.size());
  found.resize(HWY_DYNAMIC_DISPATCH(rays_near_plane)(
      rays, x_.size(), rounded.data(), static_cast<float>(kRelative * factor),
      static_cast<float>(kRelative * factor * variance + kAbsolute), found.data()));
}

}  // namespace hybrid_slam
#endif  // HWY_ONCE
