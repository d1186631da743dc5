#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "frontend/place_recognition/vocabulary.h"

namespace hybrid_slam {

// Vocabularies as files (docs/vocabulary.md): our binary one, which is mapped into memory, or
// compressed, and the text of DBoW2.

enum class VocabularyFormat {
  kMapped,      // as it is in memory: a million words are there in a moment
  kCompressed,  // for small ones that travel
  kText,        // DBoW2's
};

// The same vocabulary gives the same bytes (of the same version of zstd). Throws OutputError.
void save_vocabulary(const std::filesystem::path& path, const Vocabulary& vocabulary,
                     VocabularyFormat format);

// Reads either kind of file, told by its content. Throws InputError, one line with file, place and
// reason, for a file that is cut off, damaged or no vocabulary, and for one whose kind of
// descriptors is not the one that is `expected`. A text without a kind, as DBoW2 writes it, is of
// plain SIFT.
Vocabulary load_vocabulary(const std::filesystem::path& path,
                           std::optional<DescriptorKind> expected = std::nullopt);

// The binary kind from memory that stays, aligned to 64 bytes; `name` stands for the file in
// errors.
Vocabulary read_vocabulary(std::string_view bytes, const std::string& name);

}  // namespace hybrid_slam
