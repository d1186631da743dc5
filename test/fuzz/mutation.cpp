#include <algorithm>
#include <cstring>

#include "test/fuzz/fuzz_target.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

namespace hybrid_slam {

std::string changed(std::string bytes, std::size_t most) {
  const std::size_t size = std::min(bytes.size(), most);
  bytes.resize(most);
  bytes.resize(LLVMFuzzerMutate(reinterpret_cast<std::uint8_t*>(bytes.data()), size, most));
  return bytes;
}

std::size_t hand_over(std::string_view result, std::uint8_t* data, std::size_t most) {
  if (result.size() > most) return 0;
  std::memcpy(data, result.data(), result.size());
  return result.size();
}

}  // namespace hybrid_slam
