#pragma once

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "frontend/matching/brute_force.h"
#include "frontend/matching/circular_match.h"
#include "frontend/matching/cuda/match_kernels.h"

namespace hybrid_slam::cuda {

// Two sides of a stereo frame and which right descriptor belongs to each left one, or -1.
struct StereoView {
  DescriptorsView left;
  DescriptorsView right;
  const std::vector<int>* right_of_left;
};

// What match_brute_force() and match_circular() of frontend/matching do, as kernels on a backend.
// Memory is allocated when there are more descriptors than ever before.
template <typename Backend>
class MatcherEngine {
 public:
  template <typename... BackendArguments>
  explicit MatcherEngine(BackendArguments&&... arguments)
      : backend_(std::forward<BackendArguments>(arguments)...) {}

  // Ascending by query.
  std::vector<DescriptorMatch> match(const DescriptorsView& query, const DescriptorsView& train,
                                     const BruteForceOptions& options) {
    if (query.count == 0 || train.count == 0) return {};
    reserve(std::max(query.count, train.count));
    backend_.begin_stage("match");
    const Neighbours neighbours = find_nearest(query, train, nearest_[0], nearest_[1]);
    const MatchTests tests{to_squared_bytes(options.max_descriptor_distance), options.ratio,
                           options.mutual};
    backend_.launch({blocks_for(query.count)},
                    WriteMatches{neighbours, tests, query.count, matches_});
    backend_.begin_stage("download");
    const auto count = static_cast<std::size_t>(query.count);
    backend_.download(host_matches_, matches_, count * sizeof(Match));
    backend_.begin_stage(nullptr);
    backend_.wait();
    std::vector<DescriptorMatch> matches;
    for (int i = 0; i < query.count; ++i) {
      const Match& match = host_matches_[i];
      if (match.train >= 0) matches.push_back({i, match.train, match.squared_distance});
    }
    return matches;
  }

  // Ascending by the previous index.
  std::vector<CircularMatch> match_circular(const StereoView& previous, const StereoView& current,
                                            double max_descriptor_distance) {
    reserve(std::max(previous.left.count, current.left.count));
    const Pairs from = list_pairs(previous, 0);
    const Pairs to = list_pairs(current, 1);
    if (from.count == 0 || to.count == 0) return {};
    backend_.begin_stage("upload");
    backend_.upload(chosen_, host_chosen_, static_cast<std::size_t>(4 * capacity_) * sizeof(int));
    backend_.begin_stage("match");
    const auto side = [&](const DescriptorsView& a, const int* of_a, const DescriptorsView& b,
                          const int* of_b, std::size_t number) {
      const DescriptorsView query = gather(a, of_a, from.count, 2 * number);
      const DescriptorsView train = gather(b, of_b, to.count, 2 * number + 1);
      return find_nearest(query, train, nearest_[2 * number], nearest_[2 * number + 1]);
    };
    const Neighbours left = side(previous.left, from.left, current.left, to.left, 0);
    const Neighbours right = side(previous.right, from.right, current.right, to.right, 1);
    const MatchTests tests{to_squared_bytes(max_descriptor_distance), 1.0, true};
    backend_.launch({blocks_for(from.count)},
                    CloseCircles{left, right, tests, from.count, partners_});
    backend_.begin_stage("download");
    backend_.download(host_partners_, partners_,
                      static_cast<std::size_t>(from.count) * sizeof(int));
    backend_.begin_stage(nullptr);
    backend_.wait();
    std::vector<CircularMatch> circles;
    for (int i = 0; i < from.count; ++i) {
      const int partner = host_partners_[i];
      if (partner >= 0) circles.push_back({from.host_left[i], to.host_left[partner]});
    }
    return circles;
  }

  Backend& backend() { return backend_; }

 private:
  // Of one frame, ascending by the left index: the left and the right descriptor.
  struct Pairs {
    int count;
    const int* host_left;
    const int* left;
    const int* right;
  };

  static int blocks_for(int count) { return (count + 127) / 128; }

  template <typename T>
  T* take(int count) {
    return static_cast<T*>(backend_.allocate(static_cast<std::size_t>(count) * sizeof(T)));
  }
  template <typename T>
  T* take_for_host(int count) {
    return static_cast<T*>(backend_.allocate_for_host(static_cast<std::size_t>(count) * sizeof(T)));
  }

  void reserve(int count) {
    if (count <= capacity_) return;
    capacity_ = 0;  // and so it stays if there is too little memory
    backend_.release();
    const int capacity = std::max(count, 1024);
    const int tiles = (capacity + kTile - 1) / kTile;
    for (Nearest*& of_tiles : tiles_) of_tiles = take<Nearest>(tiles * capacity);
    for (Nearest*& nearest : nearest_) nearest = take<Nearest>(capacity);
    for (unsigned*& gathered : gathered_) gathered = take<unsigned>(capacity * kWords);
    matches_ = take<Match>(capacity);
    partners_ = take<int>(capacity);
    chosen_ = take<int>(4 * capacity);
    host_matches_ = take_for_host<Match>(capacity);
    host_partners_ = take_for_host<int>(capacity);
    host_chosen_ = take_for_host<int>(4 * capacity);
    std::memset(host_chosen_, 0, static_cast<std::size_t>(4 * capacity) * sizeof(int));
    capacity_ = capacity;
  }

  Pairs list_pairs(const StereoView& stereo, int frame) {
    int* const left = host_chosen_ + 2 * frame * capacity_;
    int* const right = left + capacity_;
    int count = 0;
    for (std::size_t i = 0; i < stereo.right_of_left->size(); ++i) {
      if ((*stereo.right_of_left)[i] < 0) continue;
      left[count] = static_cast<int>(i);
      right[count++] = (*stereo.right_of_left)[i];
    }
    return {count, left, chosen_ + (left - host_chosen_), chosen_ + (right - host_chosen_)};
  }

  DescriptorsView gather(const DescriptorsView& from, const int* chosen, int count,
                         std::size_t number) {
    backend_.launch({blocks_for(count * kWords)},
                    GatherDescriptors{from.words, chosen, count, gathered_[number]});
    return {gathered_[number], count};
  }

  Neighbours find_nearest(const DescriptorsView& query, const DescriptorsView& train,
                          Nearest* of_queries, Nearest* of_trains) {
    backend_.launch({train.tiles(), query.tiles()},
                    NearestOfTiles{query, train, tiles_[0], tiles_[1]});
    backend_.launch(
        {blocks_for(query.count + train.count)},
        MergeTiles{query.count, train.count, tiles_[0], tiles_[1], of_queries, of_trains});
    return {of_queries, of_trains};
  }

  Backend backend_;
  int capacity_ = 0;
  Nearest* tiles_[2] = {};    // per tile: of queries, of train descriptors
  Nearest* nearest_[4] = {};  // of queries, of train descriptors, twice
  unsigned* gathered_[4] = {};
  Match* matches_ = nullptr;
  Match* host_matches_ = nullptr;
  int* partners_ = nullptr;
  int* host_partners_ = nullptr;
  int* chosen_ = nullptr;
  int* host_chosen_ = nullptr;
};

}  // namespace hybrid_slam::cuda
