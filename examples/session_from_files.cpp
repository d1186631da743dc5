// Tracks a dataset and saves its map: session_from_files DATASET MAP.hslam. Component: slam.
#include <hybrid_slam/apps/slam/replay.h>
#include <hybrid_slam/apps/slam/version.h>
#include <hybrid_slam/cameras/files/output_file.h>

#include <cstdio>

using namespace hybrid_slam;

int main(int argc, char** argv) try {
  if (argc != 3) return std::puts("usage: session_from_files DATASET MAP.hslam"), 2;
  std::printf("hybrid_slam %s (%s)\n", kVersion, kGitCommit);
  const auto sequence = open_sequence(argv[1], SequenceLayout::kAuto, "");
  const SequenceInfo& info = sequence->info();
  int tracked = 0;
  SessionObservers observers;
  observers.frame = [&](const FrameResult& frame) {
    tracked += frame.has_pose();
    const Eigen::Vector3d place = origin_in_a(frame.tracked.cam_from_world);
    std::printf("%.3f %s %.4f %.4f %.4f\n", to_seconds(frame.time), to_string(frame.state),
                place.x(), place.y(), place.z());
  };
  Session session({info.stereo, info.fisheye}, {}, {.mode = SessionMode::kEveryFrame}, observers);
  for (std::size_t i = 0; i < sequence->size(); ++i) {
    FrameImages images = sequence->read(i);
    session.push(
        StereoImages{to_nanoseconds(images.time), std::move(images.left), std::move(images.right)});
  }
  session.finish();
  session.save(argv[2]);
  std::printf("%d of %zu frames, %zu landmarks\n", tracked, sequence->size(),
              session.map()->landmark_count());
  return tracked > 0 ? 0 : 4;
} catch (const std::exception& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 3;
}
