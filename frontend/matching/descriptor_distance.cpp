#include "frontend/matching/descriptor_distance.h"

#include <stdexcept>

// Compiled once per instruction set; the best one that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frontend/matching/descriptor_distance.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hybrid_slam {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

std::int32_t one_distance(const std::uint8_t* a, const std::uint8_t* b) {
  // At most 16 lanes of 16 bits: the 128 bytes are a multiple of every such vector.
  const hn::CappedTag<std::int16_t, 16> d16;
  const hn::RepartitionToWide<decltype(d16)> d32;
  const hn::Rebind<std::uint8_t, decltype(d16)> d8;
  auto sum0 = hn::Zero(d32);
  auto sum1 = hn::Zero(d32);
  for (std::size_t i = 0; i < 128; i += hn::Lanes(d16)) {
    const auto difference =
        hn::Sub(hn::PromoteTo(d16, hn::LoadU(d8, a + i)), hn::PromoteTo(d16, hn::LoadU(d8, b + i)));
    sum0 = hn::ReorderWidenMulAccumulate(d32, difference, difference, sum0, sum1);
  }
  return hn::GetLane(hn::SumOfLanes(d32, hn::Add(sum0, sum1)));
}

void many_distances(const std::uint8_t* query, const Descriptor* descriptors, const int* candidates,
                    std::size_t count, std::int32_t* distances) {
  for (std::size_t k = 0; k < count; ++k) {
    distances[k] = one_distance(query, descriptors[candidates[k]].data());
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace hybrid_slam
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hybrid_slam {

HWY_EXPORT(one_distance);
HWY_EXPORT(many_distances);

std::int32_t squared_distance(const Descriptor& a, const Descriptor& b) {
  return HWY_DYNAMIC_DISPATCH(one_distance)(a.data(), b.data());
}

void squared_distances(const Descriptor& query, std::span<const Descriptor> descriptors,
                       std::span<const int> candidates, std::span<std::int32_t> distances) {
  if (candidates.size() != distances.size()) throw std::logic_error("squared_distances: sizes");
  HWY_DYNAMIC_DISPATCH(many_distances)
  (query.data(), descriptors.data(), candidates.data(), candidates.size(), distances.data());
}

}  // namespace hybrid_slam
#endif  // HWY_ONCE
