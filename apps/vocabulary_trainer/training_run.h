#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "frontend/features/sift.h"
#include "frontend/place_recognition/vocabulary_training.h"

namespace hybrid_slam {

struct TrainingRunOptions {
  VocabularyTrainingOptions training;
  SiftOptions sift;
  int threads = 1;                // at least one
  std::filesystem::path scratch;  // folder of the temporary files: 256 bytes per descriptor
};

struct TrainingRun {
  Vocabulary vocabulary;
  std::uint64_t descriptors = 0;
};

// The images that the arguments name: files as they are, folders stand for the .png and .jpg files
// in them, by name. Throws InputError for what does not exist and for folders without images.
std::vector<std::filesystem::path> find_images(const std::vector<std::string>& arguments);

// Trains a vocabulary on the images' features. The same images and options give the same
// vocabulary, whatever the number of threads. Throws InputError for an image that cannot be read
// and for images without features.
TrainingRun train_on_images(const std::vector<std::filesystem::path>& images,
                            const TrainingRunOptions& options, const TrainingProgress& progress);

}  // namespace hybrid_slam
