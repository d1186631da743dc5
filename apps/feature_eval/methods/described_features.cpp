#include "apps/feature_eval/methods/described_features.h"

#include <limits>
#include <stdexcept>

#include <opencv2/core.hpp>

#include "frontend/matching/brute_force.h"
#include "frontend/matching/descriptor_distance.h"

namespace hybrid_slam {
namespace {

std::vector<FeatureMatch> match_bytes(const std::vector<Descriptor>& query,
                                      const std::vector<Descriptor>& train, double ratio) {
  const NearestNeighbours nearest = find_nearest(query, train);
  std::vector<FeatureMatch> matches;
  for (std::size_t q = 0; q < query.size(); ++q) {
    const int t = nearest.best[q];
    if (!passes_ratio(nearest.best_distance[q], nearest.second_distance[q], ratio)) continue;
    if (nearest.best_query[static_cast<std::size_t>(t)] != static_cast<int>(q)) continue;
    matches.push_back({static_cast<int>(q), t, from_squared_bytes(nearest.best_distance[q])});
  }
  return matches;
}

// Rows that belong to somebody else, as OpenCV sees them.
template <typename T>
cv::Mat as_matrix(const std::vector<T>& values, int columns) {
  if (columns <= 0 || values.size() % static_cast<std::size_t>(columns) != 0) {
    throw std::logic_error("descriptors are not rows of one length");
  }
  return {static_cast<int>(values.size()) / columns, columns, cv::traits::Type<T>::value,
          const_cast<T*>(values.data())};
}

// `distances`: [query][train].
template <typename T>
std::vector<FeatureMatch> match_by_distances(const cv::Mat& distances, double ratio) {
  std::vector<int> best_query(static_cast<std::size_t>(distances.cols), 0);
  for (int q = 1; q < distances.rows; ++q) {
    const T* const row = distances.ptr<T>(q);
    for (int t = 0; t < distances.cols; ++t) {
      int& best = best_query[static_cast<std::size_t>(t)];
      if (row[t] < distances.at<T>(best, t)) best = q;
    }
  }
  std::vector<FeatureMatch> matches;
  for (int q = 0; q < distances.rows; ++q) {
    const T* const row = distances.ptr<T>(q);
    T first = std::numeric_limits<T>::max(), second = first;
    int nearest = -1;
    for (int t = 0; t < distances.cols; ++t) {
      if (row[t] < first) {
        second = first;
        first = row[t];
        nearest = t;
      } else if (row[t] < second) {
        second = row[t];
      }
    }
    if (nearest < 0 || best_query[static_cast<std::size_t>(nearest)] != q) continue;
    const bool clear = distances.cols == 1 || first < ratio * second;
    if (clear) matches.push_back({q, nearest, static_cast<double>(first)});
  }
  return matches;
}

std::vector<FeatureMatch> match_rows(const cv::Mat& query, const cv::Mat& train, int norm,
                                     double ratio) {
  if (query.cols != train.cols) throw std::logic_error("descriptors of different lengths");
  cv::Mat distances;
  cv::batchDistance(query, train, distances, norm == cv::NORM_L2 ? CV_32F : CV_32S, cv::noArray(),
                    norm);
  return norm == cv::NORM_L2 ? match_by_distances<float>(distances, ratio)
                             : match_by_distances<int>(distances, ratio);
}

}  // namespace

std::vector<FeatureMatch> match_described(const DescribedFeatures& query,
                                          const DescribedFeatures& train, double ratio) {
  if (query.keypoints.empty() || train.keypoints.empty()) return {};
  if (query.descriptors.index() != train.descriptors.index()) {
    throw std::logic_error("descriptors of different kinds");
  }
  if (const auto* const bytes = std::get_if<std::vector<Descriptor>>(&query.descriptors)) {
    return match_bytes(*bytes, std::get<std::vector<Descriptor>>(train.descriptors), ratio);
  }
  if (const auto* const floats = std::get_if<FloatDescriptors>(&query.descriptors)) {
    const auto& others = std::get<FloatDescriptors>(train.descriptors);
    return match_rows(as_matrix(floats->values, floats->length),
                      as_matrix(others.values, others.length), cv::NORM_L2, ratio);
  }
  const auto& bits = std::get<BitDescriptors>(query.descriptors);
  const auto& others = std::get<BitDescriptors>(train.descriptors);
  return match_rows(as_matrix(bits.values, bits.bytes), as_matrix(others.values, others.bytes),
                    cv::NORM_HAMMING, ratio);
}

}  // namespace hybrid_slam
