#pragma once

#include <array>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "apps/report/map_figures.h"
#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

// A line of frames.csv, with what other files say of the frame. Counts are NaN where a line has
// none (inputs that were left out).
struct RunFrame {
  bool stereo = true;
  double time = 0;  // [s]
  std::string state, source, prediction, causes;
  // In the final map where there is one, else as it was known when the frame was tracked.
  std::optional<Rigid3d> world_from_cam;
  double sigma_position = kUnknown;  // [m]
  double sigma_rotation = kUnknown;  // [degrees]
  double features = kUnknown, stereo_matches = kUnknown, inliers = kUnknown, odometer = kUnknown;
  double component = kUnknown;
  double row_error = kUnknown;  // of the pair [px]
  double cpu_ms = kUnknown;     // timing.csv
  double behind_ms = kUnknown;  // likewise
  double error = kUnknown;      // errors.csv [m]
  // Of the position along the axes of covariance_base [m^2]: xx xy xz yy yz zz.
  std::array<double, 6> covariance;
  std::optional<KeyframeId> covariance_base;
};

// Frames of one camera in a row of which none has a pose.
struct LostStretch {
  std::size_t first = 0;  // into RunStory::frames
  std::size_t last = 0;
  std::size_t frames = 0;
  std::optional<std::size_t> before;  // the last frame with a pose before it
  std::string cause;                  // for people: what most of the frames had, or their counts
};

// What happened in a run, frame by frame.
struct RunStory {
  std::vector<RunFrame> frames;  // in the order of frames.csv
  std::vector<LostStretch> losses;
  double span = 0;           // from the first stereo frame to the last [s]
  double period = kUnknown;  // median time between two stereo frames [s]
};

// Finds losses, span and period of the frames that are there.
void complete_story(RunStory& story);

// Reads frames.csv, and timing.csv and errors.csv where they are, of a folder of results. `map`:
// the run's; null: none. Empty where there is no frames.csv. Throws InputError.
RunStory read_story(const std::filesystem::path& folder, const MapSnapshot* map);

}  // namespace hybrid_slam
