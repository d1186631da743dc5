// SIFT on the CPU, one thread: stage by stage, whole, and OpenCV's in the same run. Counters:
// features kept, extrema found, and the growth of the process' memory by one extractor and its
// first image [MB]. The image is the first of the shared data's H1, scaled, or noise where there is
// none.
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>

#include <benchmark/benchmark.h>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "frontend/features/cpu/cpu_sift.h"

namespace hybrid_slam {
namespace {

struct Case {
  int width, height;
  bool upsample;
};

cv::Mat noise() {
  cv::Mat sum(768, 1024, CV_32F, cv::Scalar(128));
  cv::RNG random(1);
  for (int size = 2; size <= 64; size *= 2) {
    cv::Mat coarse(768 / size + 1, 1024 / size + 1, CV_32F), fine;
    random.fill(coarse, cv::RNG::NORMAL, 0, 8);
    cv::resize(coarse, fine, sum.size(), 0, 0, cv::INTER_CUBIC);
    sum += fine;
  }
  sum.convertTo(sum, CV_8U);
  return sum;
}

cv::Mat pixels(const Case& c) {
  static const cv::Mat kImage = [] {
    const char* data = std::getenv("HYBRID_SLAM_DATA");
    const std::string path =
        std::string(data ? data : "") + "/uwsynth/hybrid/H1/images/raw/0_left.jpg";
    const cv::Mat image = data ? cv::imread(path, cv::IMREAD_GRAYSCALE) : cv::Mat();
    return image.empty() ? noise() : image;
  }();
  cv::Mat scaled;
  cv::resize(kImage, scaled, cv::Size(c.width, c.height), 0, 0, cv::INTER_CUBIC);
  return scaled;
}

GrayImage image_of(const Case& c) {
  const cv::Mat mat = pixels(c);
  return {c.width, c.height, std::vector<std::uint8_t>(mat.data, mat.data + mat.total())};
}

SiftOptions options_of(const Case& c) {
  SiftOptions options;
  options.upsample = c.upsample;
  return options;
}

// A line of /proc/self/status [MB].
double process_memory(const std::string& key) {
  std::ifstream status("/proc/self/status");
  std::string word;
  while (status >> word) {
    if (word != key) continue;
    double kilobytes = 0;
    status >> kilobytes;
    return kilobytes / 1024;
  }
  return 0;
}

void memory(benchmark::State& state, const Case& c) {
  const GrayImage image = image_of(c);
  for (auto _ : state) {
    std::ofstream("/proc/self/clear_refs") << 5;  // the peak counts from here
    const double before = process_memory("VmRSS:");
    CpuSift sift(options_of(c));
    benchmark::DoNotOptimize(sift.extract(image, nullptr));
    state.counters["MB"] = process_memory("VmHWM:") - before;
  }
}

void scale_space(benchmark::State& state, const Case& c) {
  const GrayImage image = image_of(c);
  SiftOptions options = options_of(c);
  options.contrast_threshold =
      1000;  // no sample passes: blurs, differences and the first comparison
  CpuSift sift(options);
  for (auto _ : state) benchmark::DoNotOptimize(sift.detect(image, nullptr));
}

void detect(benchmark::State& state, const Case& c) {
  const GrayImage image = image_of(c);
  CpuSift sift(options_of(c));
  for (auto _ : state) benchmark::DoNotOptimize(sift.detect(image, nullptr));
  state.counters["extrema"] = static_cast<double>(sift.detect(image, nullptr).size());
}

void select(benchmark::State& state, const Case& c) {
  CpuSift sift(options_of(c));
  sift.detect(image_of(c), nullptr);
  for (auto _ : state) benchmark::DoNotOptimize(sift.select());
}

void orient(benchmark::State& state, const Case& c) {
  CpuSift sift(options_of(c));
  sift.detect(image_of(c), nullptr);
  const std::vector<sift::Extremum> selected = sift.select();
  for (auto _ : state) benchmark::DoNotOptimize(sift.orient(selected));
}

void describe(benchmark::State& state, const Case& c) {
  CpuSift sift(options_of(c));
  sift.detect(image_of(c), nullptr);
  const std::vector<sift::Extremum> selected = sift.select();
  const CpuSift::Oriented oriented = sift.orient(selected);
  for (auto _ : state) benchmark::DoNotOptimize(sift.describe(oriented));
}

void extract(benchmark::State& state, const Case& c) {
  const GrayImage image = image_of(c);
  CpuSift sift(options_of(c));
  FeatureSet features;
  for (auto _ : state) features = sift.extract(image, nullptr);
  state.counters["features"] = static_cast<double>(features.size());
}

// OpenCV always upsamples.
void opencv(benchmark::State& state, const Case& c) {
  cv::setNumThreads(1);
  const cv::Mat image = pixels(c);
  const SiftOptions options = options_of(c);
  const auto sift = cv::SIFT::create(options.max_features, options.octave_layers,
                                     options.contrast_threshold * options.octave_layers / 255,
                                     options.edge_threshold, options.initial_sigma);
  std::vector<cv::KeyPoint> keypoints;
  for (auto _ : state) {
    cv::Mat descriptors;
    keypoints.clear();
    sift->detectAndCompute(image, cv::noArray(), keypoints, descriptors);
  }
  state.counters["features"] = static_cast<double>(keypoints.size());
}

const bool kRegistered = [] {
  for (const Case& c : {Case{1024, 768, false}, Case{1024, 768, true}, Case{1355, 1002, false},
                        Case{1355, 1002, true}}) {
    const std::string size = std::to_string(c.width) + "x" + std::to_string(c.height);
    const std::string name = size + (c.upsample ? "/upsampled/" : "/plain/");
    const auto add = [&](const std::string& stage, auto function) {
      return benchmark::RegisterBenchmark((name + stage).c_str(), function, c)
          ->Unit(benchmark::kMillisecond);
    };
    add("memory", memory)->Iterations(1);
    add("scale_space", scale_space);
    add("detect", detect);
    add("select", select);
    add("orient", orient);
    add("describe", describe);
    add("extract", extract);
    if (c.upsample) add("opencv", opencv);
  }
  return true;
}();

}  // namespace
}  // namespace hybrid_slam
