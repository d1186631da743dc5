#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <limits>

namespace hybrid_slam {

// An id that cannot be mistaken for another kind's. Ids count up from 0 and are never reused.
template <typename Tag>
struct StrongId {
  static constexpr std::uint32_t kInvalid = std::numeric_limits<std::uint32_t>::max();

  std::uint32_t value = kInvalid;

  constexpr StrongId() = default;
  constexpr explicit StrongId(std::uint32_t v) : value(v) {}
  constexpr bool valid() const { return value != kInvalid; }
  constexpr auto operator<=>(const StrongId&) const = default;
};

using KeyframeId = StrongId<struct KeyframeTag>;
using LandmarkId = StrongId<struct LandmarkTag>;
using CameraId = StrongId<struct CameraTag>;

}  // namespace hybrid_slam

template <typename Tag>
struct std::hash<hybrid_slam::StrongId<Tag>> {
  std::size_t operator()(hybrid_slam::StrongId<Tag> id) const noexcept { return id.value; }
};
