#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/report/map_figures.h"
#include "cameras/geometry/rigid3d.h"

// Arrays as the page reads them: {"type": "f64|f32|u32|u16|u8", "data": base64}, little endian.

namespace hybrid_slam {

static_assert(std::endian::native == std::endian::little,
              "the page reads numbers as memory has them");

std::string base64(const void* data, std::size_t size);

template <typename T>
nlohmann::ordered_json page_array(const std::vector<T>& values) {
  const char* type = "f64";
  if constexpr (std::is_same_v<T, float>) type = "f32";
  if constexpr (std::is_same_v<T, std::uint32_t>) type = "u32";
  if constexpr (std::is_same_v<T, std::uint16_t>) type = "u16";
  if constexpr (std::is_same_v<T, std::uint8_t>) type = "u8";
  return {{"type", type}, {"data", base64(values.data(), values.size() * sizeof(T))}};
}

// Places of `wanted` out of `count`, evenly.
std::vector<std::size_t> evenly(std::size_t count, std::size_t wanted);

// Words by numbers.
class NameNumbers {
 public:
  std::uint8_t operator[](const std::string& name) {
    const auto [at, added] = places_.try_emplace(name, names_.size());
    if (added) names_.push_back(name);
    return static_cast<std::uint8_t>(std::min<std::size_t>(at->second, 255));
  }
  const std::vector<std::string>& list() const { return names_; }

 private:
  std::map<std::string, std::size_t> places_;
  std::vector<std::string> names_;
};

struct PoseArrays {
  std::vector<float> positions;  // x y z each
  std::vector<float> rotations;  // quaternions x y z w

  void add(const std::optional<Rigid3d>& pose) {
    for (int i = 0; i < 3; ++i) {
      positions.push_back(static_cast<float>(pose ? pose->translation()[i] : kUnknown));
    }
    for (int i = 0; i < 4; ++i) {
      rotations.push_back(static_cast<float>(pose ? pose->params[i] : kUnknown));
    }
  }
};

}  // namespace hybrid_slam
