#include "apps/vocabulary_trainer/training_run.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <stdexcept>

#include "apps/slam/parallel_for.h"
#include "cameras/files/input_error.h"
#include "frontend/input/image_file.h"
#include "frontend/place_recognition/descriptor_store.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kImagesPerThread = 4;  // read at once

bool is_image(const fs::path& path) {
  const std::string extension = path.extension().string();
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

// Writes the features of all images, in their order, into both stores.
class Extraction {
 public:
  explicit Extraction(const TrainingRunOptions& options)
      : options_(options), at_once_(kImagesPerThread * static_cast<std::size_t>(options.threads)) {
    for (int i = 0; i < options.threads; ++i) extractors_.push_back(make_sift(options.sift));
  }

  // Where each image's descriptors end.
  std::vector<std::uint64_t> run(const std::vector<fs::path>& images, DescriptorStore& by_image,
                                 DescriptorStore& to_train, const TrainingProgress& progress) {
    std::vector<std::uint64_t> ends;
    for (std::size_t begin = 0; begin < images.size(); begin += at_once_) {
      std::vector<FeatureSet> features(std::min(at_once_, images.size() - begin));
      parallel_for(features.size(), options_.threads, [&](std::size_t i, std::size_t worker) {
        const fs::path& path = images[begin + i];
        const GrayImage image = read_gray_image(path);
        features[i] = extractors_[worker]->extract(image, nullptr);
      });
      for (const FeatureSet& image : features) {
        by_image.append(image.descriptors);
        to_train.append(image.descriptors);
        ends.push_back(by_image.size());
        if (image.size() > 0) kind_ = image.kind;
      }
      progress("images read", begin + features.size(), images.size());
    }
    return ends;
  }

  DescriptorKind kind() const { return kind_; }

 private:
  const TrainingRunOptions& options_;
  const std::size_t at_once_;
  std::vector<std::unique_ptr<SiftExtractor>> extractors_;  // one per thread
  DescriptorKind kind_ = DescriptorKind::kNone;
};

}  // namespace

std::vector<fs::path> find_images(const std::vector<std::string>& arguments) {
  std::vector<fs::path> images;
  for (const std::string& argument : arguments) {
    if (!fs::is_directory(argument)) {
      if (!fs::exists(argument)) throw InputError(argument + ": no such file or folder");
      images.emplace_back(argument);
      continue;
    }
    std::vector<fs::path> found;
    for (const auto& entry : fs::directory_iterator(argument)) {
      if (entry.is_regular_file() && is_image(entry.path())) found.push_back(entry.path());
    }
    if (found.empty()) throw InputError(argument + ": no images in this folder");
    std::sort(found.begin(), found.end());
    images.insert(images.end(), found.begin(), found.end());
  }
  return images;
}

TrainingRun train_on_images(const std::vector<fs::path>& images, const TrainingRunOptions& options,
                            const TrainingProgress& progress) {
  DescriptorStore by_image(options.scratch);
  DescriptorStore to_train(options.scratch);
  Extraction extraction(options);
  const auto image_ends = extraction.run(images, by_image, to_train, progress);
  if (by_image.size() < 2)
    throw InputError(images.front().string() + ": the images have no features");
  const ParallelFor parallel = [&](std::size_t count,
                                   const std::function<void(std::size_t)>& body) {
    parallel_for(count, options.threads, [&](std::size_t i, std::size_t) { body(i); });
  };
  const Vocabulary tree =
      train_vocabulary(to_train.map(), extraction.kind(), options.training, parallel, progress);
  return {weigh_words(tree, by_image.map(), image_ends, parallel, progress), by_image.size()};
}

}  // namespace hybrid_slam
