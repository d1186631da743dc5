#include "frontend/place_recognition/vocabulary_text.h"

#include "test/fuzz/fuzz_target.h"

void hybrid_slam::read_input(std::string_view input) { read_vocabulary_text(input, "vocabulary"); }
