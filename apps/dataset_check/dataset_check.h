#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "apps/dataset_check/pair_survey.h"
#include "apps/slam/slam_options.h"
#include "frontend/features/sift_device.h"
#include "frontend/input/image_sequence.h"

// What a dataset is fit for, without SLAM.
namespace hybrid_slam {

struct DatasetCheckOptions {
  SlamOptions slam;  // features are found as SLAM would
  SiftDevice device = SiftDevice::kCpu;
  int threads = 1;
  std::size_t pairs = 100;  // in which features are found and matched, at most
};

// Times between the frames that follow one another.
struct FrameRate {
  double duration = 0;  // from the first to the last [s]
  double period = 0;    // median [s]
  double shortest = 0;  // [s]
  double longest = 0;   // [s]
};

// A frame with something worth a look.
struct NamedFrame {
  std::size_t frame = 0;
  double value = 0;  // seconds of a gap
  std::string text;  // why a frame cannot be read
};

// The images of one camera.
struct ImageSurvey {
  std::size_t images = 0;
  double brightness = 0;  // median of the grey levels that 99 % of the pixels do not exceed
  double blur = 0;        // median, see ImageQuality
  std::map<std::string, int> causes;  // frames by what is wrong with them: "dark"; see Cause
};

// Of the pairs in which features were found.
struct FeatureSurvey {
  std::size_t frames = 0;
  double features = 0;  // median, of the left or the single image
  double matched = 0;   // median share of the features with a match along the row
};

// A finding spoils the SLAM, or may.
struct Finding {
  std::string name;  // one word: "rows"
  std::string text;  // with its number, and what to look at
};

struct DatasetCheck {
  SequenceInfo info;
  FrameRate rate;
  std::vector<NamedFrame> gaps;        // longer than five periods
  std::vector<NamedFrame> unreadable;  // stereo pairs
  std::size_t fisheye_missing = 0;
  ImageSurvey stereo, fisheye;
  FeatureSurvey stereo_features, fisheye_features;
  PairSurvey pairs{1, 1};
  std::vector<std::string> missing;  // what could be there and is not
  std::vector<Finding> findings;     // empty: nothing speaks against it
  bool cancelled = false;            // what is said is of the frames up to then
};

// Reads all images. `progress`: frames done, of how many. Throws InputError as FrameExtractor does.
DatasetCheck check_dataset(const ImageSequence& sequence, const DatasetCheckOptions& options,
                           const std::function<void(std::size_t, std::size_t)>& progress,
                           const std::stop_token& stop);

}  // namespace hybrid_slam
