// Brute-force matching against OpenCV's BFMatcher in the same run. Ours finds the two nearest
// neighbours and, in the same pass, the best in the other direction; OpenCV the two nearest only.
#include <algorithm>
#include <random>

#include <benchmark/benchmark.h>
#include <opencv2/features2d.hpp>

#include "frontend/matching/brute_force.h"

namespace hybrid_slam {
namespace {

std::vector<Descriptor> random_descriptors(std::int64_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<Descriptor> descriptors(static_cast<std::size_t>(count));
  for (Descriptor& descriptor : descriptors) {
    // About the distribution of RootSIFT's bytes.
    for (std::uint8_t& byte : descriptor) byte = static_cast<std::uint8_t>(random() % 79);
  }
  return descriptors;
}

void brute_force(benchmark::State& state) {
  const std::vector<Descriptor> query = random_descriptors(state.range(0), 1);
  const std::vector<Descriptor> train = random_descriptors(state.range(0), 2);
  for (auto _ : state) benchmark::DoNotOptimize(find_nearest(query, train));
}

cv::Mat to_mat(const std::vector<Descriptor>& descriptors, int type) {
  cv::Mat bytes(static_cast<int>(descriptors.size()), 128, CV_8U);
  for (int i = 0; i < bytes.rows; ++i) {
    const Descriptor& descriptor = descriptors[static_cast<std::size_t>(i)];
    std::copy(descriptor.begin(), descriptor.end(), bytes.ptr<std::uint8_t>(i));
  }
  cv::Mat result;
  bytes.convertTo(result, type);
  return result;
}

void opencv(benchmark::State& state, int type) {
  cv::setNumThreads(1);
  const cv::Mat query = to_mat(random_descriptors(state.range(0), 1), type);
  const cv::Mat train = to_mat(random_descriptors(state.range(0), 2), type);
  const cv::BFMatcher matcher(cv::NORM_L2);
  for (auto _ : state) {
    std::vector<std::vector<cv::DMatch>> matches;
    matcher.knnMatch(query, train, matches, 2);
    benchmark::DoNotOptimize(matches);
  }
}

void opencv_float(benchmark::State& state) { opencv(state, CV_32F); }
void opencv_bytes(benchmark::State& state) { opencv(state, CV_8U); }

BENCHMARK(brute_force)->Arg(2000)->Arg(4000)->Unit(benchmark::kMillisecond);
BENCHMARK(opencv_float)->Arg(2000)->Arg(4000)->Unit(benchmark::kMillisecond);
BENCHMARK(opencv_bytes)->Arg(2000)->Arg(4000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace hybrid_slam
