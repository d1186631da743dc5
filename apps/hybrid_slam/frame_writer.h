#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "apps/slam/replay.h"
#include "cameras/files/line_file.h"

namespace hybrid_slam {

// Writes what becomes of each frame as it happens, so that all of it is there if the program is
// killed: frames.csv, timing.csv, fisheye_in_left.csv, and the trajectories as they were known at
// each moment (docs/reliability.md). Does not throw once the files are there: what cannot be
// written is left out.
class FrameWriter {
 public:
  // `warn` is told once of each file that cannot be written to. Throws OutputError.
  FrameWriter(const std::filesystem::path& folder, bool fisheye,
              std::function<void(const std::string&)> warn);

  void frame(const FrameResult& frame);
  void left_out(const LeftOut& input);
  void times(const FrameTimes& times);

 private:
  struct Trajectory {
    LineFile online;
    LineFile estimate;  // the same until the run's end, when it is written anew
  };
  void append(LineFile& file, const std::string& line);
  void write_pose(Trajectory& files, const FrameResult& frame);

  std::function<void(const std::string&)> warn_;
  LineFile frames_;
  LineFile times_;
  LineFile fisheye_in_left_;
  Trajectory stereo_;
  Trajectory fisheye_;
};

}  // namespace hybrid_slam
