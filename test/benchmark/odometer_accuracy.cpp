// How far the stereo odometer's motions are from the truth, from frame to frame, and whether their
// covariances say so.
//   odometer_accuracy DATASET SEQUENCE [FRAMES [STEP [TRUTH]]]
// STEP: frames from one to the next. TRUTH: a trajectory of the left camera, where the dataset's
// own is not to be taken. Prints the error of the length along the way [%], translation and
// rotation as root mean squares, and the normalised error squared per degree of freedom (NEES).
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "apps/slam/frame_extractor.h"
#include "apps/slam/replay.h"
#include "cameras/files/input_error.h"
#include "cameras/geometry/se3.h"
#include "frontend/input/image_sequence.h"
#include "frontend/input/trajectory_file.h"
#include "frontend/odometry/stereo_odometer.h"

namespace hybrid_slam {
namespace {

constexpr double kSameTime = 1e-3;  // [s]

struct Figures {
  int motions = 0, missing = 0;
  double inliers = 0, along = 0, length = 0, squared_off = 0, squared_turn = 0, nees = 0;

  void add(const Rigid3d& truth, const std::optional<StereoMotion>& motion) {
    if (!motion) {
      ++missing;
      return;
    }
    ++motions;
    inliers += static_cast<double>(motion->inliers.size());
    const Eigen::Vector3d way = truth.translation();
    const Eigen::Vector3d off = motion->current_from_previous.translation() - way;
    along += off.dot(way.normalized());
    length += way.norm();
    squared_off += off.squaredNorm();
    const Vector6d error = se3_log(motion->current_from_previous * inverse(truth));
    squared_turn += error.tail<3>().squaredNorm();
    nees += error.dot(motion->covariance.ldlt().solve(error)) / 6;
  }

  void print() const {
    if (motions == 0) {
      std::printf("no motion with a truth\n");
      return;
    }
    const double n = motions;
    std::printf(
        "%d motions, %d missing, %.0f inliers: length %+.3f %%, %.3f mm, %.4f deg, NEES %.2f\n",
        motions, missing, inliers / n, 100 * along / length, 1e3 * std::sqrt(squared_off / n),
        std::sqrt(squared_turn / n) * 180 / std::numbers::pi, nees / n);
  }
};

const Rigid3d* truth_at(const std::vector<StampedPose>& truth, double time) {
  for (const StampedPose& pose : truth) {
    if (std::abs(pose.time - time) < kSameTime) return &pose.world_from_cam;
  }
  return nullptr;
}

StereoImages read(const ImageFrameSource& source, std::size_t index) {
  return std::get<StereoImages>(std::move(source.read(index).inputs.front()));
}

FrameExtractor make_extractor(const ImageFrameSource& source, const SlamOptions& options) {
  FirstImages first;
  for (std::size_t i = 0; i < FirstImages::kStereo; ++i) {
    first.stereo.push_back(std::make_shared<StereoImages>(read(source, i)));
  }
  return FrameExtractor(source.cameras(), options, SiftDevice::kCpu, first);
}

Figures run(const ImageSequence& sequence, std::size_t frames, std::size_t step,
            const std::vector<StampedPose>& truth) {
  SlamOptions options;
  options.distribute();
  const ImageFrameSource source(sequence);
  const StereoOdometer odometer(source.cameras().stereo, options.tracking.odometer);
  FrameExtractor extractor = make_extractor(source, options);
  StageTimes times;
  std::map<std::size_t, StereoFeatures> features;  // of the last frames
  Figures figures;
  for (std::size_t i = 0; i < frames; ++i) {
    features[i] = extractor.extract(read(source, i), false, times).frame.features;
    if (i < step) continue;
    const Rigid3d* now = truth_at(truth, sequence.info().times[i]);
    const Rigid3d* before = truth_at(truth, sequence.info().times[i - step]);
    if (now != nullptr && before != nullptr) {
      figures.add(inverse(*now) * *before, odometer.estimate(features[i - step], features[i]));
    }
    features.erase(i - step);
  }
  return figures;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  using namespace hybrid_slam;
  if (argc < 3) {
    std::fprintf(stderr, "usage: odometer_accuracy DATASET SEQUENCE [FRAMES [STEP [TRUTH]]]\n");
    return 2;
  }
  try {
    const auto sequence = open_sequence(argv[1], SequenceLayout::kAuto, argv[2]);
    const std::size_t frames =
        argc > 3 ? std::min(sequence->size(), std::stoul(argv[3])) : sequence->size();
    const std::size_t step = argc > 4 ? std::stoul(argv[4]) : 1;
    run(*sequence, frames, step, argc > 5 ? read_trajectory(argv[5]).poses : sequence->info().truth)
        .print();
  } catch (const InputError& error) {
    std::fprintf(stderr, "odometer_accuracy: error: %s\n", error.what());
    return 1;
  } catch (const std::logic_error&) {
    std::fprintf(stderr, "odometer_accuracy: error: FRAMES and STEP are whole numbers\n");
    return 2;
  }
  return 0;
}
