// From push to pose, as a program with live cameras has it: pushes a sequence's images, which are
// in memory, at a rate, and says how long it took until the observer had the frame, and what push()
// itself cost.
//   session_latency DATASET SEQUENCE stereo|hybrid RATE [FRAMES [SOAK_MINUTES]]
// With SOAK_MINUTES the sequence runs there and back for so long, and the memory is said: what is
// resident, and what of it is in use, which is not blurred by what the allocator keeps.
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "apps/slam/session.h"
#include "frontend/input/image_sequence.h"

namespace hybrid_slam {
namespace {

using Clock = std::chrono::steady_clock;

double thread_cpu_ms() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

double resident_mb() {
  malloc_trim(0);
  std::size_t size = 0;
  std::size_t resident = 0;
  std::ifstream("/proc/self/statm") >> size >> resident;
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

double allocated_mb() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd) / 1e6;
}

void print(const char* name, std::vector<double> values) {
  if (values.empty()) return;
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    return values[std::min(values.size() - 1,
                           static_cast<std::size_t>(share * static_cast<double>(values.size())))];
  };
  std::printf("%-22s p50 %8.2f  p95 %8.2f  p99 %8.2f  max %8.2f ms\n", name, at(0.5), at(0.95),
              at(0.99), values.back());
}

class Latencies {
 public:
  void pushed(CameraKind camera, Nanoseconds time) {
    const std::lock_guard lock(mutex_);
    pushed_[{camera, time}] = Clock::now();
  }
  void tracked(const FrameResult& frame) {
    const std::lock_guard lock(mutex_);
    const auto at = pushed_.find({frame.camera, frame.time});
    const std::chrono::duration<double, std::milli> passed = Clock::now() - at->second;
    pushed_.erase(at);
    of_[frame.camera].push_back(passed.count());
    with_pose_ += frame.has_pose() ? 1 : 0;
  }
  void print_all() const {
    for (const auto& [camera, values] : of_) print(to_string(camera), values);
    std::printf("%d frames with a pose\n", with_pose_);
  }

 private:
  std::mutex mutex_;
  std::map<std::pair<CameraKind, Nanoseconds>, Clock::time_point> pushed_;
  std::map<CameraKind, std::vector<double>> of_;
  int with_pose_ = 0;
};

int run(const std::string& dataset, const std::string& name, bool hybrid, double rate,
        std::size_t count, double soak_minutes) {
  const auto sequence = open_sequence(dataset, SequenceLayout::kAuto, name,
                                      hybrid ? SequenceCameras::kHybrid : SequenceCameras::kStereo);
  std::vector<FrameImages> images;
  for (std::size_t i = 0; i < std::min(count, sequence->size()); ++i) {
    images.push_back(sequence->read(i));
  }
  const auto pushes =
      soak_minutes > 0 ? static_cast<std::size_t>(soak_minutes * 60 * rate) : images.size();
  Latencies latencies;
  SessionObservers observers;
  observers.frame = [&](const FrameResult& frame) { latencies.tracked(frame); };
  SessionOptions options;
  options.threads = 2;
  SlamOptions slam;
  slam.distribute();
  Session session({sequence->info().stereo, sequence->info().fisheye}, slam, options, observers);
  std::vector<double> wall;
  std::vector<double> cpu;
  const auto push = [&](SensorInput input) {
    latencies.pushed(camera_of(input), time_of(input));
    const double before = thread_cpu_ms();
    const auto start = Clock::now();
    session.push(std::move(input));
    wall.push_back(std::chrono::duration<double, std::milli>(Clock::now() - start).count());
    cpu.push_back(thread_cpu_ms() - before);
  };
  const auto start = Clock::now();
  for (std::size_t i = 0; i < pushes; ++i) {
    const std::size_t turn = i % std::max<std::size_t>(2 * images.size() - 2, 1);
    const FrameImages& one = images[turn < images.size() ? turn : 2 * images.size() - 2 - turn];
    const auto due = std::chrono::duration<double>(static_cast<double>(i) / rate);
    std::this_thread::sleep_until(start + std::chrono::duration_cast<Clock::duration>(due));
    const Nanoseconds time = to_nanoseconds(due.count());
    push(StereoImages{time, one.left, one.right});
    if (hybrid) push(FisheyeImage{time, one.fisheye});
    if (soak_minutes > 0 && i % static_cast<std::size_t>(60 * rate) == 0) {
      std::printf("%5.1f min %8.1f MB, %8.2f in use, %zu keyframes, %zu landmarks\n",
                  due.count() / 60, resident_mb(), allocated_mb(), session.map()->keyframe_count(),
                  session.map()->landmark_count());
      std::fflush(stdout);
    }
  }
  session.finish();
  const SessionCounts counts = session.counts();
  std::printf("%s, %zu moments at %.1f Hz: %ld dropped, %ld events not heard\n",
              hybrid ? "hybrid" : "stereo", pushes, rate,
              static_cast<long>(counts.stereo.dropped + counts.fisheye.dropped),
              static_cast<long>(counts.overruns));
  latencies.print_all();
  print("push(), wall", wall);
  print("push(), CPU", cpu);
  return 0;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  if (argc < 5) {
    std::fprintf(
        stderr,
        "usage: session_latency DATASET SEQUENCE stereo|hybrid RATE [FRAMES [SOAK_MINUTES]]\n");
    return 2;
  }
  return hybrid_slam::run(argv[1], argv[2], std::string(argv[3]) == "hybrid", std::atof(argv[4]),
                          argc > 5 ? static_cast<std::size_t>(std::atol(argv[5])) : 1000,
                          argc > 6 ? std::atof(argv[6]) : 0);
}
