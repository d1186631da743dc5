#include "test/frontend/place_recognition/sample_vocabulary.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "test/support/random.h"

namespace hybrid_slam {

std::vector<Descriptor> random_descriptors(int count, int centers, std::uint64_t seed) {
  Random random(seed);
  std::vector<std::vector<double>> center;
  for (int i = 0; i < centers; ++i) {
    std::vector<double> values;
    for (int k = 0; k < 128; ++k) values.push_back(std::abs(random.gaussian()));
    center.push_back(std::move(values));
  }
  std::vector<Descriptor> descriptors(static_cast<std::size_t>(count));
  for (Descriptor& descriptor : descriptors) {
    std::vector<double> values = center[random.below(center.size())];
    double squares = 0;
    for (double& value : values) {
      value = std::max(0.0, value + 0.15 * random.gaussian());
      squares += value * value;
    }
    for (std::size_t k = 0; k < descriptor.size(); ++k) {
      descriptor[k] = static_cast<std::uint8_t>(512 * values[k] / std::sqrt(squares) + 0.5);
    }
  }
  return descriptors;
}

Vocabulary small_vocabulary(int branching, int levels, std::uint64_t seed) {
  std::vector<Descriptor> descriptors = random_descriptors(3000, 100, seed);
  const std::vector<Descriptor> by_image = descriptors;
  VocabularyTrainingOptions options;
  options.branching = branching;
  options.levels = levels;
  const Vocabulary tree =
      train_vocabulary(descriptors, DescriptorKind::kRootSift, options, serial_for, no_progress);
  std::vector<std::uint64_t> image_ends;
  for (std::uint64_t end = 50; end <= by_image.size(); end += 50) image_ends.push_back(end);
  return weigh_words(tree, by_image, image_ends, serial_for, no_progress);
}

Vocabulary scene_vocabulary(const SyntheticScene& scene) {
  std::vector<Descriptor> descriptors;
  std::vector<std::uint64_t> image_ends;
  for (const SyntheticFrame& frame : scene.frames) {
    const auto& seen = frame.observations->features.descriptors;
    descriptors.insert(descriptors.end(), seen.begin(), seen.end());
    image_ends.push_back(descriptors.size());
  }
  const std::vector<Descriptor> by_image = descriptors;
  VocabularyTrainingOptions options;
  options.branching = 8;
  options.levels = 3;
  const Vocabulary tree =
      train_vocabulary(descriptors, DescriptorKind::kSynthetic, options, serial_for, no_progress);
  return weigh_words(tree, by_image, image_ends, serial_for, no_progress);
}

Vocabulary in_floats(const Vocabulary& vocabulary) {
  auto floats = std::make_shared<std::vector<FloatDescriptor>>();
  for (const Descriptor& descriptor : vocabulary.tables().bytes) {
    floats->emplace_back();
    std::transform(descriptor.begin(), descriptor.end(), floats->back().begin(),
                   [](std::uint8_t byte) { return static_cast<float>(byte) / 512; });
  }
  VocabularyTables tables = vocabulary.tables();
  tables.kind = DescriptorKind::kPlainSift;
  tables.bytes = {};
  tables.floats = *floats;
  // Both live as long as the result.
  const auto owner = std::make_shared<std::pair<Vocabulary, decltype(floats)>>(vocabulary, floats);
  return Vocabulary(tables, owner);
}

bool same_tables(const Vocabulary& a, const Vocabulary& b) {
  const VocabularyTables& s = a.tables();
  const VocabularyTables& t = b.tables();
  return s.kind == t.kind && s.branching == t.branching && s.levels == t.levels &&
         std::ranges::equal(s.first_child, t.first_child) &&
         std::ranges::equal(s.weights, t.weights) && std::ranges::equal(s.bytes, t.bytes) &&
         std::ranges::equal(s.floats, t.floats);
}

FeatureSet features_of(std::vector<Descriptor> descriptors) {
  FeatureSet features;
  features.kind = DescriptorKind::kRootSift;
  features.keypoints.resize(descriptors.size());
  features.descriptors = std::move(descriptors);
  return features;
}

void backward_for(std::size_t count, const std::function<void(std::size_t)>& body) {
  for (std::size_t i = count; i > 0; --i) body(i - 1);
}

}  // namespace hybrid_slam
