#pragma once

#include "frontend/place_recognition/vocabulary.h"

namespace hybrid_slam {

// The vocabulary that is part of the program: RootSIFT, ten branches, four levels. Trained on
// rendered images alone, by make_default_vocabulary.sh.
Vocabulary default_vocabulary();

}  // namespace hybrid_slam
