#include "frontend/place_recognition/clustering.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

#include "frontend/matching/descriptor_distance.h"
#include "frontend/pose/random_sampler.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kMaxSample = std::size_t{1} << 14;  // of which the seeds are chosen
constexpr std::size_t kChunk = std::size_t{1} << 13;      // descriptors in one piece of work
// Iterations end when a smaller share of the descriptors changes its cluster.
constexpr std::size_t kFewChanges = 1000;

std::vector<Descriptor> sample_of(std::span<const Descriptor> descriptors, RandomSampler& sampler) {
  if (descriptors.size() <= kMaxSample) return {descriptors.begin(), descriptors.end()};
  std::vector<Descriptor> sample(kMaxSample);
  const int count = static_cast<int>(descriptors.size());
  for (Descriptor& d : sample) d = descriptors[static_cast<std::size_t>(sampler.below(count))];
  return sample;
}

// The index at which the running sum of the distances first exceeds a random number below it.
std::size_t draw(const std::vector<std::int32_t>& distances, RandomSampler& sampler) {
  const auto total = std::accumulate(distances.begin(), distances.end(), std::int64_t{0});
  // Two draws, since the sum may not fit into one.
  constexpr int kSteps = 1 << 30;
  const double share = (sampler.below(kSteps) + sampler.below(kSteps) * 0x1p-30) * 0x1p-30;
  auto left = static_cast<std::int64_t>(share * static_cast<double>(total));
  std::size_t last = 0;
  for (std::size_t i = 0; i < distances.size(); ++i) {
    if (distances[i] == 0) continue;
    last = i;
    left -= distances[i];
    if (left < 0) break;
  }
  return last;
}

// k-means++ (Arthur and Vassilvitskii 2007). Different from one another, at least one.
std::vector<Descriptor> choose_seeds(std::span<const Descriptor> descriptors, int count,
                                     RandomSampler& sampler) {
  const std::vector<Descriptor> sample = sample_of(descriptors, sampler);
  std::vector<Descriptor> seeds{
      sample[static_cast<std::size_t>(sampler.below(static_cast<int>(sample.size())))]};
  std::vector<std::int32_t> nearest(sample.size(), std::numeric_limits<std::int32_t>::max());
  for (;;) {
    for (std::size_t i = 0; i < sample.size(); ++i) {
      nearest[i] = std::min(nearest[i], squared_distance(sample[i], seeds.back()));
    }
    const bool all_taken =
        std::all_of(nearest.begin(), nearest.end(), [](std::int32_t d) { return d == 0; });
    if (all_taken || seeds.size() == static_cast<std::size_t>(count)) return seeds;
    seeds.push_back(sample[draw(nearest, sampler)]);
  }
}

// What one piece of work adds to the means.
struct Sums {
  std::vector<std::array<std::uint32_t, std::tuple_size_v<Descriptor>>> sum;
  std::vector<std::uint32_t> count;
  std::size_t changed = 0;
};
static_assert(kChunk * 255 <= std::numeric_limits<std::uint32_t>::max());

class KMeans {
 public:
  KMeans(std::span<Descriptor> descriptors, std::vector<Descriptor> means,
         const ParallelFor& parallel)
      : descriptors_(descriptors),
        means_(std::move(means)),
        labels_(descriptors.size(), std::numeric_limits<std::uint8_t>::max()),
        chunks_((descriptors.size() + kChunk - 1) / kChunk),
        parallel_(parallel) {}

  // Ends with descriptors assigned to the means as they are.
  void iterate(int max_iterations) {
    for (int i = 0;; ++i) {
      const std::size_t changed = assign();
      if (i == max_iterations || changed <= descriptors_.size() / kFewChanges) return;
      update_means();
    }
  }

  // Sorts the descriptors by cluster, in place.
  std::vector<Cluster> partition() {
    std::vector<Cluster> clusters(means_.size());
    for (std::size_t c = 0; c < means_.size(); ++c) clusters[c].mean = means_[c];
    for (const std::uint8_t label : labels_) ++clusters[label].count;
    std::vector<std::size_t> next(means_.size(), 0);
    for (std::size_t c = 1; c < means_.size(); ++c) next[c] = next[c - 1] + clusters[c - 1].count;
    std::size_t end = 0;
    for (std::size_t c = 0; c < means_.size(); ++c) {
      end += clusters[c].count;
      while (next[c] < end) {
        const std::size_t at = next[c];
        const std::size_t to = next[labels_[at]]++;
        std::swap(descriptors_[at], descriptors_[to]);
        std::swap(labels_[at], labels_[to]);
      }
    }
    std::erase_if(clusters, [](const Cluster& cluster) { return cluster.count == 0; });
    return clusters;
  }

 private:
  // How many changed their cluster.
  std::size_t assign() {
    parallel_(chunks_.size(), [this](std::size_t chunk) { assign_chunk(chunk); });
    std::size_t changed = 0;
    for (const Sums& chunk : chunks_) changed += chunk.changed;
    return changed;
  }

  void assign_chunk(std::size_t index) {
    Sums& chunk = chunks_[index];
    chunk.sum.assign(means_.size(), {});
    chunk.count.assign(means_.size(), 0);
    chunk.changed = 0;
    std::vector<int> candidates(means_.size());
    std::iota(candidates.begin(), candidates.end(), 0);
    std::vector<std::int32_t> distances(means_.size());
    const std::size_t end = std::min(descriptors_.size(), (index + 1) * kChunk);
    for (std::size_t i = index * kChunk; i < end; ++i) {
      squared_distances(descriptors_[i], means_, candidates, distances);
      const auto label = static_cast<std::uint8_t>(
          std::min_element(distances.begin(), distances.end()) - distances.begin());
      chunk.changed += label != labels_[i];
      labels_[i] = label;
      ++chunk.count[label];
      for (std::size_t k = 0; k < descriptors_[i].size(); ++k) {
        chunk.sum[label][k] += descriptors_[i][k];
      }
    }
  }

  // A cluster that lost all its descriptors keeps its mean.
  void update_means() {
    for (std::size_t c = 0; c < means_.size(); ++c) {
      std::array<std::uint64_t, std::tuple_size_v<Descriptor>> sum{};
      std::uint64_t count = 0;
      for (const Sums& chunk : chunks_) {
        count += chunk.count[c];
        for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += chunk.sum[c][k];
      }
      for (std::size_t k = 0; k < sum.size() && count > 0; ++k) {
        means_[c][k] = static_cast<std::uint8_t>((sum[k] + count / 2) / count);
      }
    }
  }

  std::span<Descriptor> descriptors_;
  std::vector<Descriptor> means_;
  std::vector<std::uint8_t> labels_;
  std::vector<Sums> chunks_;
  const ParallelFor& parallel_;
};

}  // namespace

void serial_for(std::size_t count, const std::function<void(std::size_t)>& body) {
  for (std::size_t i = 0; i < count; ++i) body(i);
}

std::vector<Cluster> cluster_descriptors(std::span<Descriptor> descriptors,
                                         const ClusteringOptions& options,
                                         const ParallelFor& parallel) {
  if (descriptors.empty()) return {};
  RandomSampler sampler(options.seed);
  KMeans kmeans(descriptors, choose_seeds(descriptors, options.clusters, sampler), parallel);
  kmeans.iterate(options.max_iterations);
  return kmeans.partition();
}

}  // namespace hybrid_slam
