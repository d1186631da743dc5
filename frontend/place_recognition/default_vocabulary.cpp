#include "frontend/place_recognition/default_vocabulary.h"

#include "frontend/place_recognition/vocabulary_file.h"

// The file HS_DEFAULT_VOCABULARY as it is.
asm(".pushsection .rodata\n"
    ".balign 64\n"
    "hs_default_vocabulary_begin:\n"
    ".incbin \"" HS_DEFAULT_VOCABULARY
    "\"\n"
    "hs_default_vocabulary_end:\n"
    ".popsection\n");

extern "C" {
extern const char hs_default_vocabulary_begin[];
extern const char hs_default_vocabulary_end[];
}

namespace hybrid_slam {

Vocabulary default_vocabulary() {
  const auto size =
      static_cast<std::size_t>(hs_default_vocabulary_end - hs_default_vocabulary_begin);
  return read_vocabulary({hs_default_vocabulary_begin, size}, "the default vocabulary");
}

}  // namespace hybrid_slam
