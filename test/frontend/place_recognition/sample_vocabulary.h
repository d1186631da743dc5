#pragma once

#include <cstdint>
#include <vector>

#include "frontend/place_recognition/vocabulary_training.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

// Descriptors of the length of RootSIFT's in bytes: `centers` different ones, each with noise.
std::vector<Descriptor> random_descriptors(int count, int centers, std::uint64_t seed);

// Trained on 3000 of them.
Vocabulary small_vocabulary(int branching = 4, int levels = 3, std::uint64_t seed = 1);

// Of what is seen in a synthetic scene: 512 words.
Vocabulary scene_vocabulary(const SyntheticScene& scene);

// The same tree in floats, of plain SIFT.
Vocabulary in_floats(const Vocabulary& vocabulary);

bool same_tables(const Vocabulary& a, const Vocabulary& b);

FeatureSet features_of(std::vector<Descriptor> descriptors);

// Calls body from the last index to the first.
void backward_for(std::size_t count, const std::function<void(std::size_t)>& body);

inline void no_progress(const std::string&, std::size_t, std::size_t) {}

}  // namespace hybrid_slam
