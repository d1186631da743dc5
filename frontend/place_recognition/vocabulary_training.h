#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "frontend/place_recognition/clustering.h"
#include "frontend/place_recognition/vocabulary.h"

namespace hybrid_slam {

struct VocabularyTrainingOptions {
  int branching = 10;
  int levels = 6;
  int max_iterations = 20;  // of k-means, per node
  std::uint64_t seed = 0;

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// Called now and then with what is being counted, how much of it is done, and of how much.
using TrainingProgress =
    std::function<void(const std::string& unit, std::size_t done, std::size_t total)>;

// Hierarchical k-means: a tree whose words have no weights yet (all 0). Reorders the descriptors,
// which may lie in a mapped file, and needs about one byte for each besides, and the tree. The same
// descriptors in the same order give the same tree, whatever `parallel` does. Throws
// std::invalid_argument for options that cannot be used, and if there are fewer than two different
// descriptors.
Vocabulary train_vocabulary(std::span<Descriptor> descriptors, DescriptorKind kind,
                            const VocabularyTrainingOptions& options, const ParallelFor& parallel,
                            const TrainingProgress& progress);

// The same tree, each word weighted by its inverse document frequency: the logarithm of (images /
// images with the word), 0 if no image has it. Image i has the descriptors from image_ends[i - 1]
// (0 for the first) to image_ends[i] - 1.
Vocabulary weigh_words(const Vocabulary& vocabulary, std::span<const Descriptor> descriptors,
                       std::span<const std::uint64_t> image_ends, const ParallelFor& parallel,
                       const TrainingProgress& progress);

}  // namespace hybrid_slam
