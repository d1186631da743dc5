#include "frontend/place_recognition/loop_detector.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "backend/map/covisibility.h"

namespace hybrid_slam {
namespace {

constexpr int kCovisible = 15;               // landmarks in common
constexpr std::size_t kGroupNeighbors = 10;  // of a candidate, whose scores are accumulated
constexpr std::size_t kMaxGroups = 50;       // of the most similar candidates: bounds the work
constexpr std::size_t kEnoughForBase = 10;   // candidates

bool overlap(const std::vector<KeyframeId>& a, const std::vector<KeyframeId>& b) {
  auto i = a.begin();
  auto j = b.begin();
  while (i != a.end() && j != b.end()) {
    if (*i == *j) return true;
    if (*i < *j) {
      ++i;
    } else {
      ++j;
    }
  }
  return false;
}

// The score with the least similar covisible keyframe; 0 without any.
double least_neighbor_score(const KeyframeDatabase& places, const Keyframe& keyframe) {
  double least = 1;
  bool any = false;
  for (const Covisible& edge : keyframe.covisible) {
    if (edge.shared_landmarks < kCovisible || !places.contains(edge.id)) continue;
    least = std::min(least, bow_score(places.bow_of(keyframe.id), places.bow_of(edge.id)));
    any = true;
  }
  return any ? least : 0;
}

std::vector<KeyframeId> with_covisible(const Keyframe& keyframe) {
  std::vector<KeyframeId> ids{keyframe.id};
  for (const Covisible& edge : keyframe.covisible) {
    if (edge.shared_landmarks >= kCovisible) ids.push_back(edge.id);
  }
  std::sort(ids.begin(), ids.end());
  return ids;
}

}  // namespace

std::string LoopDetectorOptions::validate() const {
  if (min_gap < 1 || max_shared_landmarks < 1 || consistency < 1 || max_candidates < 1) {
    return "loop detector: min_gap, max_shared_landmarks, consistency and max_candidates must be "
           "positive";
  }
  const auto is_share = [](double value) { return value >= 0 && value <= 1; };
  if (!is_share(min_word_share) || !is_share(min_score_share)) {
    return "loop detector: min_word_share and min_score_share must lie in [0, 1]";
  }
  if (!(min_base_ratio >= 1)) return "loop detector: min_base_ratio must be at least 1";
  return {};
}

LoopDetector::LoopDetector(const LoopDetectorOptions& options) : options_(options) {
  const std::string fault = options.validate();
  if (!fault.empty()) throw std::logic_error(fault);
}

std::vector<KeyframeId> LoopDetector::detect(const MapSnapshot& map, const KeyframeDatabase& places,
                                             KeyframeId id) {
  const Keyframe* keyframe = map.find(id);
  if (keyframe == nullptr || !places.contains(id)) return {};
  std::vector<Group>& last = last_[keyframe->observations->camera];
  std::vector<Group> now = groups(map, candidates(map, places, *keyframe));
  std::vector<KeyframeId> found;
  for (Group& group : now) {
    for (const Group& before : last) {
      if (overlap(before.members, group.members)) {
        group.successive = std::max(group.successive, before.successive + 1);
      }
    }
    if (group.successive < options_.consistency) continue;
    if (found.size() < static_cast<std::size_t>(options_.max_candidates)) {
      found.push_back(group.best);
    }
  }
  last = std::move(now);
  return found;
}

// Most similar first; their scores are those above the base.
std::vector<SimilarKeyframe> LoopDetector::candidates(const MapSnapshot& map,
                                                      const KeyframeDatabase& places,
                                                      const Keyframe& keyframe) const {
  std::vector<SimilarKeyframe> found =
      places.similar(places.bow_of(keyframe.id), places.size(), {});
  const auto gap = static_cast<std::uint32_t>(options_.min_gap);
  std::erase_if(found, [&](const SimilarKeyframe& other) {
    const Keyframe* const there = map.find(other.keyframe);
    if (there == nullptr || !(other.keyframe < keyframe.id)) return true;
    const bool recent = keyframe.id.value < gap || other.keyframe.value > keyframe.id.value - gap;
    return (recent && there->component == keyframe.component) ||
           shared_landmarks(keyframe, other.keyframe) >= options_.max_shared_landmarks;
  });
  const double base = found.size() >= kEnoughForBase ? found[found.size() * 3 / 4].score
                                                     : least_neighbor_score(places, keyframe);
  int most_words = 0;
  for (const SimilarKeyframe& other : found) most_words = std::max(most_words, other.shared_words);
  std::erase_if(found, [&](const SimilarKeyframe& other) {
    return other.shared_words < options_.min_word_share * most_words ||
           other.score < options_.min_base_ratio * base;
  });
  for (SimilarKeyframe& other : found) other.score -= base;
  return found;
}

// Of different places, best first.
std::vector<LoopDetector::Group> LoopDetector::groups(
    const MapSnapshot& map, const std::vector<SimilarKeyframe>& candidates) const {
  std::map<KeyframeId, double> score_of;
  for (const SimilarKeyframe& candidate : candidates) {
    score_of.emplace(candidate.keyframe, candidate.score);
  }
  std::vector<Group> all;
  double best_score = 0;
  for (std::size_t i = 0; i < std::min(candidates.size(), kMaxGroups); ++i) {
    Group group{candidates[i].keyframe, candidates[i].score, {}, 1};
    for (const Covisible& edge : map.covisible(group.best, kCovisible, kGroupNeighbors)) {
      const auto other = score_of.find(edge.id);
      if (other == score_of.end()) continue;
      group.score += other->second;
      if (other->second > score_of.at(group.best)) group.best = edge.id;
    }
    best_score = std::max(best_score, group.score);
    all.push_back(std::move(group));
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Group& a, const Group& b) { return a.score > b.score; });
  std::vector<Group> distinct;
  for (Group& group : all) {
    if (group.score < options_.min_score_share * best_score) break;
    group.members = with_covisible(map.at(group.best));
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const Group& other) {
      return std::binary_search(other.members.begin(), other.members.end(), group.best);
    });
    if (!known) distinct.push_back(std::move(group));
  }
  return distinct;
}

}  // namespace hybrid_slam
