#include "frontend/place_recognition/vocabulary.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "frontend/matching/descriptor_distance.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kSideBySide = 16;  // descriptors that go down the tree together

// Where each level begins, and where the last one ends. Of a valid table.
std::vector<NodeId> level_begins(std::span<const NodeId> first_child) {
  std::vector<NodeId> begins{0, 1};
  for (;;) {
    const NodeId end = first_child[begins.back()];
    if (end == begins.back()) return begins;
    begins.push_back(end);
  }
}

// Plain SIFT in bytes is 512 times the unit descriptor, as RootSIFT is.
FloatDescriptor to_floats(const Descriptor& descriptor) {
  FloatDescriptor result;
  for (std::size_t i = 0; i < result.size(); ++i) result[i] = descriptor[i] * (1.0F / 512);
  return result;
}

float squared_distance(const FloatDescriptor& a, const FloatDescriptor& b) {
  float sum[8] = {};  // eight sums let the compiler use vectors
  for (std::size_t i = 0; i < a.size(); i += 8) {
    for (std::size_t j = 0; j < 8; ++j) sum[j] += (a[i + j] - b[i + j]) * (a[i + j] - b[i + j]);
  }
  return std::accumulate(sum, sum + 8, 0.0F);
}

constexpr auto kCandidates = [] {
  std::array<int, kMaxBranching> indices{};
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}();

NodeId nearest(const Descriptor& descriptor, std::span<const Descriptor> children) {
  std::array<std::int32_t, kMaxBranching> distances;
  const std::span used(distances.data(), children.size());
  squared_distances(descriptor, children, std::span(kCandidates).first(children.size()), used);
  return static_cast<NodeId>(std::min_element(used.begin(), used.end()) - used.begin());
}

NodeId nearest(const FloatDescriptor& descriptor, std::span<const FloatDescriptor> children) {
  std::array<float, kMaxBranching> distances;
  const std::span used(distances.data(), children.size());
  for (std::size_t i = 0; i < used.size(); ++i) {
    used[i] = squared_distance(descriptor, children[i]);
  }
  return static_cast<NodeId>(std::min_element(used.begin(), used.end()) - used.begin());
}

template <typename D>
void prefetch(std::span<const D> means) {
  constexpr std::size_t kCacheLine = 64;
  const char* bytes = reinterpret_cast<const char*>(means.data());
  for (std::size_t at = 0; at < means.size_bytes(); at += kCacheLine)
    __builtin_prefetch(bytes + at);
}

}  // namespace

std::string_view kind_name(DescriptorKind kind) {
  switch (kind) {
    case DescriptorKind::kNone:
      return "no";
    case DescriptorKind::kRootSiftOpenCv:
      return "RootSIFT by OpenCV";
    case DescriptorKind::kSynthetic:
      return "synthetic";
    case DescriptorKind::kRootSift:
      return "RootSIFT";
    case DescriptorKind::kPlainSift:
      return "plain SIFT";
  }
  return "unknown";
}

std::string VocabularyTables::validate() const {
  if (branching < 2 || branching > kMaxBranching) return "branching is not in 2..20";
  if (levels < 1 || levels > kMaxLevels) return "levels are not in 1..10";
  const std::size_t count = nodes();
  if (count < 2) return "there are no words";
  if (first_child.size() != count + 1) return "as many nodes as weights are needed";
  if ((bytes.empty() ? floats.size() : bytes.size()) != count ||
      (!bytes.empty() && !floats.empty())) {
    return "as many descriptors as nodes are needed";
  }
  if (first_child[0] != 1 || first_child[count] != count) return "the nodes are no tree";
  for (std::size_t i = 0; i < count; ++i) {
    const NodeId begin = first_child[i];
    const NodeId end = first_child[i + 1];
    if (end < begin || (end > begin && begin <= i)) return "the nodes are no tree";
    if (end - begin > static_cast<NodeId>(branching)) return "a node has too many children";
    if (!(weights[i] >= 0) || std::isinf(weights[i])) return "a weight is not finite";
  }
  if (level_begins(first_child).size() > static_cast<std::size_t>(levels) + 2) {
    return "the tree is deeper than its levels";
  }
  return {};
}

Vocabulary::Vocabulary(const VocabularyTables& tables, std::shared_ptr<const void> owner)
    : tables_(tables), owner_(std::move(owner)) {
  const std::string wrong = tables_.validate();
  if (!wrong.empty()) throw std::logic_error("vocabulary: " + wrong);
  level_begin_ = level_begins(tables_.first_child);
  for (std::size_t i = 0; i < tables_.nodes(); ++i) {
    words_ += tables_.first_child[i] == tables_.first_child[i + 1];
  }
  while (guide_level_ < depth() &&
         level_begin(guide_level_ + 2) - level_begin(guide_level_ + 1) <= kMaxGuides) {
    ++guide_level_;
  }
}

// All of them level by level: while one is compared, the means that the others need come from
// memory, which a million words mostly wait for.
template <typename D>
void Vocabulary::descend(std::span<const D> descriptors, std::span<const D> means,
                         std::span<Place> places) const {
  bool done = false;
  for (int level = 1; !done; ++level) {
    done = true;
    for (std::size_t i = 0; i < descriptors.size(); ++i) {
      Place& place = places[i];
      const NodeId begin = tables_.first_child[place.word];
      const NodeId end = tables_.first_child[place.word + 1];
      if (begin == end) continue;
      done = false;
      place.word = begin + nearest(descriptors[i], means.subspan(begin, end - begin));
      if (level <= guide_level_) place.guide = place.word;
      prefetch(means.subspan(tables_.first_child[place.word], tables_.first_child[place.word + 1] -
                                                                  tables_.first_child[place.word]));
    }
  }
}

std::vector<Vocabulary::Place> Vocabulary::find(DescriptorKind kind,
                                                std::span<const Descriptor> descriptors) const {
  if (kind != tables_.kind) throw std::logic_error("vocabulary: descriptors of another kind");
  std::vector<Place> places(descriptors.size());
  for (std::size_t begin = 0; begin < descriptors.size(); begin += kSideBySide) {
    const std::size_t count = std::min(kSideBySide, descriptors.size() - begin);
    const auto some = descriptors.subspan(begin, count);
    const auto some_places = std::span(places).subspan(begin, count);
    if (tables_.floats.empty()) {
      descend(some, tables_.bytes, some_places);
    } else {
      std::array<FloatDescriptor, kSideBySide> floats;
      std::transform(some.begin(), some.end(), floats.begin(), to_floats);
      descend(std::span<const FloatDescriptor>(floats).first(count), tables_.floats, some_places);
    }
  }
  return places;
}

}  // namespace hybrid_slam
