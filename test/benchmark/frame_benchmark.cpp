// A whole frame, stage by stage, one thread. First each stage by itself on one pair of frames, then
// whole sequences with the mean of every stage of the pipeline as counters [ms]; "track" holds the
// odometer, everything after it happens per keyframe. Simulated frames have features but no images;
// real ones are those of KITTI s1 under HYBRID_SLAM_DATA, left out where that is not set.

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>

#include <benchmark/benchmark.h>

#include "frontend/odometry/stereo_odometer.h"
#include "test/integration/simulated_source.h"
#include "test/support/replays.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kFrames = 20;

SlamOptions slam_options() {
  SlamOptions options;
  options.distribute();
  return options;
}

const SimulatedSource& simulated() {
  static const SimulatedSource kSource = [] {
    SyntheticSceneOptions options;
    options.trajectory = SceneTrajectory::kCorridor;
    options.times = kFrames;
    options.landmarks = 2200;  // about 2000 features per frame
    options.clutter = 300;
    return SimulatedSource(make_synthetic_scene(options));
  }();
  return kSource;
}

// Null without the data.
const ImageSequence* kitti() {
  static const std::unique_ptr<ImageSequence> kSequence = []() -> std::unique_ptr<ImageSequence> {
    const char* data = std::getenv("HYBRID_SLAM_DATA");
    const auto folder = std::filesystem::path(data == nullptr ? "" : data) / "kitti";
    if (data == nullptr || !std::filesystem::is_directory(folder)) return nullptr;
    return open_sequence(folder.string(), SequenceLayout::kKitti, "s1");
  }();
  return kSequence.get();
}

StereoFeatures load(const FrameSource& source, std::size_t index) {
  Moment moment = source.read(index);
  if (auto* frame = std::get_if<ExtractedFrame>(&moment.inputs.front())) {
    return std::move(frame->frame.features);
  }
  StageTimes times;
  FrameExtractor extractor(source.cameras(), slam_options(), SiftDevice::kCpu, {});
  return extractor.extract(std::get<StereoImages>(moment.inputs.front()), false, times)
      .frame.features;
}

void sift(benchmark::State& state) {
  const FrameImages images = kitti()->read(0);
  const auto extractor = make_sift(slam_options().sift);
  for (auto _ : state) benchmark::DoNotOptimize(extractor->extract(images.left, nullptr));
}

// `images`: null where there are features only, which are then not aligned.
void stereo_match(benchmark::State& state, const FrameSource& source, const FrameImages* images) {
  const StereoFeatures features = load(source, 0);
  std::unique_ptr<const ImagePyramid> left, right;
  if (images != nullptr) {
    left = std::make_unique<const ImagePyramid>(images->left);
    right = std::make_unique<const ImagePyramid>(images->right);
  }
  const StereoMatcherOptions options = slam_options().stereo;
  for (auto _ : state) {
    benchmark::DoNotOptimize(match_stereo(features.left, features.right, left.get(), right.get(),
                                          source.cameras().stereo, options));
  }
  state.counters["features"] = static_cast<double>(features.left.size());
}

void odometer(benchmark::State& state, const FrameSource& source) {
  const StereoFeatures previous = load(source, 0);
  const StereoFeatures current = load(source, 1);
  const StereoOdometer stereo_odometer(source.cameras().stereo, slam_options().tracking.odometer);
  for (auto _ : state) benchmark::DoNotOptimize(stereo_odometer.estimate(previous, current));
}

void sequence(benchmark::State& state, const FrameSource& source) {
  ReplayOptions run;
  run.limit = kFrames;
  StageTimes times;
  RunResult result;
  for (auto _ : state) {
    result = run_every_frame(source, slam_options(), run, {});
    times.merge(result.times);
  }
  for (const auto& [stage, durations] : times.stages()) {
    state.counters[stage] = durations.mean();
  }
  state.counters["tracked"] = result.frames.tracked;
  state.counters["keyframes"] = static_cast<double>(result.map->keyframe_count());
}

const bool kRegistered = [] {
  const auto add = [](const std::string& name, auto function) {
    benchmark::RegisterBenchmark(name.c_str(), function)->Unit(benchmark::kMillisecond);
  };
  add("simulated/stereo_match",
      [](benchmark::State& state) { stereo_match(state, simulated(), nullptr); });
  add("simulated/odometer", [](benchmark::State& state) { odometer(state, simulated()); });
  add("simulated/sequence", [](benchmark::State& state) { sequence(state, simulated()); });
  if (kitti() == nullptr) return true;
  static const ImageFrameSource kSource(*kitti());
  add("kitti/sift", sift);
  add("kitti/stereo_match", [](benchmark::State& state) {
    const FrameImages images = kitti()->read(0);
    stereo_match(state, kSource, &images);
  });
  add("kitti/odometer", [](benchmark::State& state) { odometer(state, kSource); });
  add("kitti/sequence", [](benchmark::State& state) { sequence(state, kSource); });
  return true;
}();

}  // namespace
}  // namespace hybrid_slam
