#include <xxhash.h>

#include "frontend/place_recognition/vocabulary_file.h"
#include "test/fuzz/fuzz_target.h"

// Bytes are checked by two sums, see docs/vocabulary.md: most changes come with right ones.
namespace hybrid_slam {
namespace {

constexpr std::size_t kHeader = 64;

void put(std::string& bytes, std::size_t at, std::uint64_t value) {
  for (std::size_t i = 0; i < 8; ++i) bytes[at + i] = static_cast<char>(value >> (8 * i));
}

void mend_checksums(std::string& file) {
  if (file.size() < kHeader) return;
  const std::size_t stored = file.size() - kHeader;
  put(file, 40, stored);
  put(file, 48, XXH3_64bits(file.data() + kHeader, stored));
  put(file, 56, XXH3_64bits(file.data(), 56));
}

}  // namespace

void read_input(std::string_view input) { load_vocabulary(input_file(input)); }

}  // namespace hybrid_slam

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t most, unsigned seed) {
  std::string file = hybrid_slam::changed({reinterpret_cast<const char*>(data), size}, most);
  if (seed % 8 != 0) hybrid_slam::mend_checksums(file);
  return hybrid_slam::hand_over(file, data, most);
}
