#include "frontend/place_recognition/vocabulary_training.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>

namespace hybrid_slam {
namespace {

// A node with more descriptors is worked on by all threads at once, smaller ones side by side.
constexpr std::size_t kLarge = std::size_t{1} << 16;
constexpr std::size_t kNodesAtOnce = 1024;  // between two calls of progress
constexpr std::size_t kImagesAtOnce = 256;
constexpr std::uint64_t kSeedStep = 0x9e3779b97f4a7c15;  // spreads seeds of neighbouring nodes

struct Tree {
  std::vector<NodeId> first_child;
  std::vector<float> weights;
  std::vector<Descriptor> bytes;
};

class TreeBuilder {
 public:
  TreeBuilder(std::span<Descriptor> descriptors, const VocabularyTrainingOptions& options,
              const ParallelFor& parallel, const TrainingProgress& progress)
      : options_(options), parallel_(parallel), progress_(progress), level_{descriptors} {}

  std::shared_ptr<Tree> build() {
    tree_->bytes.push_back({});
    for (int level = 0; level < options_.levels && !level_.empty(); ++level) {
      unit_ = "nodes split at level " + std::to_string(level) + " of " +
              std::to_string(options_.levels);
      append(split_level());
    }
    // The last level has no children.
    tree_->first_child.resize(tree_->bytes.size() + 1, static_cast<NodeId>(tree_->bytes.size()));
    tree_->weights.assign(tree_->bytes.size(), 0);
    return tree_;
  }

 private:
  using Clusters = std::vector<Cluster>;

  Clusters split(std::size_t node, const ParallelFor& parallel) const {
    ClusteringOptions options;
    options.clusters = options_.branching;
    options.max_iterations = options_.max_iterations;
    options.seed = options_.seed + kSeedStep * (tree_->first_child.size() + node);
    return cluster_descriptors(level_[node], options, parallel);
  }

  // The clusters of each node of the level.
  std::vector<Clusters> split_level() const {
    std::vector<Clusters> clusters(level_.size());
    std::vector<std::size_t> small;
    for (std::size_t i = 0; i < level_.size(); ++i) {
      if (level_[i].size() > kLarge) {
        progress_(unit_, i - small.size(), level_.size());
        clusters[i] = split(i, parallel_);
      } else {
        small.push_back(i);
      }
    }
    const std::size_t large = level_.size() - small.size();
    for (std::size_t begin = 0; begin < small.size(); begin += kNodesAtOnce) {
      progress_(unit_, large + begin, level_.size());
      parallel_(std::min(kNodesAtOnce, small.size() - begin), [&](std::size_t i) {
        clusters[small[begin + i]] = split(small[begin + i], serial_for);
      });
    }
    progress_(unit_, level_.size(), level_.size());
    return clusters;
  }

  // Makes the clusters the next level. A node that cannot be split is a word.
  void append(const std::vector<Clusters>& clusters) {
    std::vector<std::span<Descriptor>> next;
    for (std::size_t i = 0; i < level_.size(); ++i) {
      tree_->first_child.push_back(static_cast<NodeId>(tree_->bytes.size()));
      if (clusters[i].size() < 2) continue;
      std::size_t begin = 0;
      for (const Cluster& cluster : clusters[i]) {
        next.push_back(level_[i].subspan(begin, cluster.count));
        begin += cluster.count;
        tree_->bytes.push_back(cluster.mean);
      }
    }
    if (tree_->bytes.size() > std::numeric_limits<NodeId>::max() / 2) {
      throw std::length_error("vocabulary: too many nodes");
    }
    level_ = std::move(next);
  }

  const VocabularyTrainingOptions& options_;
  const ParallelFor& parallel_;
  const TrainingProgress& progress_;
  std::vector<std::span<Descriptor>> level_;  // what is below each node of the last level
  std::string unit_;
  std::shared_ptr<Tree> tree_ = std::make_shared<Tree>();
};

std::vector<NodeId> different_words(const Vocabulary& vocabulary,
                                    std::span<const Descriptor> descriptors) {
  std::vector<NodeId> words;
  for (const auto& place : vocabulary.find(vocabulary.kind(), descriptors)) {
    words.push_back(place.word);
  }
  std::sort(words.begin(), words.end());
  words.erase(std::unique(words.begin(), words.end()), words.end());
  return words;
}

// In how many images each node is a word.
std::vector<std::uint32_t> image_counts(const Vocabulary& vocabulary,
                                        std::span<const Descriptor> descriptors,
                                        std::span<const std::uint64_t> image_ends,
                                        const ParallelFor& parallel,
                                        const TrainingProgress& progress) {
  std::vector<std::uint32_t> counts(vocabulary.tables().nodes(), 0);
  std::vector<std::vector<NodeId>> words;
  for (std::size_t begin = 0; begin < image_ends.size(); begin += kImagesAtOnce) {
    words.assign(std::min(kImagesAtOnce, image_ends.size() - begin), {});
    parallel(words.size(), [&](std::size_t i) {
      const std::size_t image = begin + i;
      const std::size_t first = image == 0 ? 0 : image_ends[image - 1];
      words[i] = different_words(vocabulary, descriptors.subspan(first, image_ends[image] - first));
    });
    for (const std::vector<NodeId>& image : words) {
      for (const NodeId word : image) ++counts[word];
    }
    progress("images weighed", begin + words.size(), image_ends.size());
  }
  return counts;
}

}  // namespace

std::string VocabularyTrainingOptions::validate() const {
  if (branching < 2 || branching > kMaxBranching) return "branching must be 2 to 20";
  if (levels < 1 || levels > kMaxLevels) return "levels must be 1 to 10";
  if (max_iterations < 1) return "max_iterations must be positive";
  return {};
}

Vocabulary train_vocabulary(std::span<Descriptor> descriptors, DescriptorKind kind,
                            const VocabularyTrainingOptions& options, const ParallelFor& parallel,
                            const TrainingProgress& progress) {
  const std::string wrong = options.validate();
  if (!wrong.empty()) throw std::invalid_argument("vocabulary training: " + wrong);
  const auto tree = TreeBuilder(descriptors, options, parallel, progress).build();
  if (tree->bytes.size() < 2) {
    throw std::invalid_argument("vocabulary training: fewer than two different descriptors");
  }
  return Vocabulary(
      {kind, options.branching, options.levels, tree->first_child, tree->weights, tree->bytes, {}},
      tree);
}

Vocabulary weigh_words(const Vocabulary& vocabulary, std::span<const Descriptor> descriptors,
                       std::span<const std::uint64_t> image_ends, const ParallelFor& parallel,
                       const TrainingProgress& progress) {
  const auto counts = image_counts(vocabulary, descriptors, image_ends, parallel, progress);
  struct Weighted {
    Vocabulary tree;  // keeps the other tables
    std::vector<float> weights;
  };
  auto weighted = std::make_shared<Weighted>(Weighted{vocabulary, {}});
  for (const std::uint32_t count : counts) {
    const double images = static_cast<double>(image_ends.size());
    weighted->weights.push_back(count == 0 ? 0 : static_cast<float>(std::log(images / count)));
  }
  VocabularyTables tables = vocabulary.tables();
  tables.weights = weighted->weights;
  return Vocabulary(tables, weighted);
}

}  // namespace hybrid_slam
