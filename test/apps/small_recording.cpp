#include "test/apps/small_recording.h"

#include <cmath>

namespace hybrid_slam {

SmallRecording make_small_recording(int moments, double right_roll) {
  SmallRecording recording;
  const double baseline = 0.12;
  const Calibrated<Pinhole> pinhole{{300, 300, 159.5, 119.5}, 320, 240};
  recording.cameras.stereo = {{300, 300, 159.5, 119.5, baseline}, 320, 240};
  recording.cameras.fisheye =
      Calibrated<KannalaBrandt>{{80, 80, 127.5, 127.5, -0.01, 0.002, 0, 0}, 256, 256};
  const TexturedGround ground = TexturedGround::with_steps();
  Rigid3d left_from_right(
      Eigen::Quaterniond(Eigen::AngleAxisd(right_roll, Eigen::Vector3d::UnitZ())),
      Eigen::Vector3d(baseline, 0, 0));
  const Rigid3d left_from_fisheye(
      Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())),
      Eigen::Vector3d(0.3, 0.2, 0.3));
  for (int i = 0; i < moments; ++i) {
    const Rigid3d world_from_left(Eigen::Quaterniond::Identity(),
                                  Eigen::Vector3d(0.02 * i - 0.3, 0.1 * std::sin(0.2 * i), 0));
    const Nanoseconds time = i * SmallRecording::kPeriod;
    SmallRecording::Moment moment;
    moment.time = time;
    moment.stereo = {time, ground.render(pinhole, world_from_left),
                     ground.render(pinhole, world_from_left * left_from_right)};
    moment.fisheye = {
        time, ground.render(*recording.cameras.fisheye, world_from_left * left_from_fisheye)};
    recording.moments.push_back(std::move(moment));
    recording.world_from_left.push_back(world_from_left);
  }
  return recording;
}

}  // namespace hybrid_slam
