#include "apps/scene_renderer/octave_kernel.h"

// Compiled once per instruction set; the best one that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "apps/scene_renderer/octave_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hybrid_slam {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, 8>;
using Words = hn::RebindToUnsigned<Floats>;
using Numbers = hn::RebindToSigned<Floats>;
using Vector = hn::Vec<Floats>;
using Bits = hn::Vec<Words>;

// One coordinate of every octave's point within its cell: distance from the lower corner, the fade
// between the corners and its derivative, and the share of either corner in the hash.
struct Axis {
  Vector from_low, fade, slope;
  Bits hash[2];
};

HWY_INLINE Axis axis_of(const float* coordinates, std::uint32_t factor) {
  const Floats d;
  const Vector p = hn::LoadU(d, coordinates);
  const Vector low = hn::Floor(p);
  const Vector t = hn::Sub(p, low), t2 = hn::Mul(t, t);
  const auto set = [](float value) HWY_ATTR { return hn::Set(Floats(), value); };
  Axis axis;
  axis.from_low = t;
  const Vector inner = hn::MulAdd(t, hn::MulAdd(t, set(6), set(-15)), set(10));
  axis.fade = hn::Mul(hn::Mul(t2, t), inner);
  axis.slope = hn::Mul(hn::Mul(set(30), t2), hn::MulAdd(t, hn::Sub(t, set(2)), set(1)));
  const Bits cell = hn::BitCast(Words(), hn::ConvertTo(Numbers(), low));
  axis.hash[0] = hn::Mul(cell, hn::Set(Words(), factor));
  axis.hash[1] = hn::Add(axis.hash[0], hn::Set(Words(), factor));
  return axis;
}

// As mixed_bits, of hashed coordinates.
HWY_INLINE Bits mix_bits(Bits h) {
  const Words d;
  h = hn::Mul(hn::Xor(h, hn::ShiftRight<15>(h)), hn::Set(d, 0x2c1b3c6dU));
  h = hn::Mul(hn::Xor(h, hn::ShiftRight<12>(h)), hn::Set(d, 0x297a2d39U));
  return hn::Xor(h, hn::ShiftRight<15>(h));
}

// Ten bits as a number from -1 to 1.
template <int kShift>
HWY_INLINE Vector component(Bits bits) {
  const Bits ten = hn::And(hn::ShiftRight<kShift>(bits), hn::Set(Words(), 1023U));
  const Vector number = hn::ConvertTo(Floats(), hn::BitCast(Numbers(), ten));
  return hn::MulAdd(number, hn::Set(Floats(), 2.0F / 1023), hn::Set(Floats(), -1.0F));
}

void sum_octaves(const OctavePoints& points, float* HWY_RESTRICT sum) {
  const Floats d;
  const Vector one = hn::Set(d, 1.0F);
  Vector value = hn::Zero(d), gx = value, gy = value, gz = value;
  for (std::size_t i = 0; i < points.count; i += hn::Lanes(d)) {
    const Axis x = axis_of(points.x + i, 0x8da6b343U), y = axis_of(points.y + i, 0xd8163841U),
               z = axis_of(points.z + i, 0xcb1ab31fU);
    const Bits seed = hn::Mul(hn::LoadU(Words(), points.seed + i), hn::Set(Words(), 0x165667b1U));
    const Vector weight = hn::LoadU(d, points.weight + i);
    for (int corner = 0; corner < 8; ++corner) {
      const int ix = corner & 1, iy = (corner >> 1) & 1, iz = corner >> 2;
      const Bits bits =
          mix_bits(hn::Xor(hn::Xor(x.hash[ix], y.hash[iy]), hn::Xor(z.hash[iz], seed)));
      const Vector cx = component<0>(bits), cy = component<10>(bits), cz = component<20>(bits);
      const auto offset = [&](const Axis& axis, int high) HWY_ATTR {
        return high ? hn::Sub(axis.from_low, one) : axis.from_low;
      };
      const auto share = [&](const Axis& axis, int high)
                             HWY_ATTR { return high ? axis.fade : hn::Sub(one, axis.fade); };
      const auto change = [&](const Axis& axis, int high)
                              HWY_ATTR { return high ? axis.slope : hn::Neg(axis.slope); };
      const Vector height = hn::Mul(
          weight,
          hn::MulAdd(cx, offset(x, ix), hn::MulAdd(cy, offset(y, iy), hn::Mul(cz, offset(z, iz)))));
      const Vector wx = share(x, ix), wy = share(y, iy), wz = share(z, iz);
      const Vector wyz = hn::Mul(wy, wz), all = hn::Mul(wx, wyz), scaled = hn::Mul(weight, all);
      value = hn::MulAdd(all, height, value);
      gx = hn::MulAdd(scaled, cx, hn::MulAdd(height, hn::Mul(change(x, ix), wyz), gx));
      gy = hn::MulAdd(scaled, cy, hn::MulAdd(height, hn::Mul(change(y, iy), hn::Mul(wx, wz)), gy));
      gz = hn::MulAdd(scaled, cz, hn::MulAdd(height, hn::Mul(change(z, iz), hn::Mul(wx, wy)), gz));
    }
  }
  sum[0] = hn::GetLane(hn::SumOfLanes(d, value));
  sum[1] = hn::GetLane(hn::SumOfLanes(d, gx));
  sum[2] = hn::GetLane(hn::SumOfLanes(d, gy));
  sum[3] = hn::GetLane(hn::SumOfLanes(d, gz));
}

}  // namespace HWY_NAMESPACE
}  // namespace hybrid_slam
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hybrid_slam {

HWY_EXPORT(sum_octaves);

void sum_octaves(const OctavePoints& points, float* sum) {
  HWY_DYNAMIC_DISPATCH(sum_octaves)(points, sum);
}

}  // namespace hybrid_slam
#endif
