#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "frontend/place_recognition/vocabulary.h"

namespace hybrid_slam {

// DBoW2's text format. First line: branching, levels, scoring (0: L1), weighting (0: TF-IDF), then,
// where others stop reading, our kind of descriptor ("root_sift" or "plain_sift"; without it, plain
// SIFT). Then a line per node, counted from 1 (0 is the root): parent, whether it is a word, 128
// numbers, weight. A parent comes before its children.

// Throws InputError with line and reason.
Vocabulary read_vocabulary_text(std::string_view text, const std::string& name);

// Hands out the text piece by piece. Of a vocabulary of RootSIFT or plain SIFT; throws
// std::logic_error for other kinds.
void write_vocabulary_text(const Vocabulary& vocabulary,
                           const std::function<void(std::string_view)>& write);

}  // namespace hybrid_slam
