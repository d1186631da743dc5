#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "apps/feature_eval/methods/described_features.h"
#include "frontend/features/image.h"
#include "frontend/features/sift.h"

// The comparison of features in the paper: how well the motion between the left camera and the
// fisheye is found from one pair of images (docs/feature_study.md).
namespace hybrid_slam {

struct StudyOptions {
  std::vector<std::string> datasets;
  std::vector<std::string> methods;
  SiftOptions sift;      // max_features holds for every method
  int every = 5;         // frames
  double threshold = 1;  // of an inlier [px], at the mean of the two cameras' focal lengths
  bool masks = false;
  std::string out = "out";
};

// Where the essential matrix is found.
enum class StudyModel { kPlane, kBearings };
inline constexpr std::array kStudyModels{StudyModel::kPlane, StudyModel::kBearings};

struct MotionErrors {
  int inliers = 0;             // 0 if no motion was found
  double rotation_deg = 180;   // likewise
  double direction_deg = 180;  // of the translation
};

struct PairResult {
  std::size_t frame = 0;
  std::size_t left_keypoints = 0;
  std::size_t fisheye_keypoints = 0;
  std::size_t matches = 0;
  std::array<MotionErrors, kStudyModels.size()> motion;  // by model
};

// Matches of the pair that is shown, in pixels.
struct ShownMatch {
  Keypoint left;
  Keypoint fisheye;
  bool inlier = false;  // of kPlane
};

struct MethodResult {
  std::string name;
  std::vector<PairResult> pairs;
  std::vector<double> image_times;  // CPU time of each image, left and fisheye in turn [ms]
  std::vector<double> match_times;  // likewise, of each pair
  std::vector<ShownMatch> shown;
};

struct SequenceResult {
  std::string name;  // unique
  std::size_t shown_frame = 0;
  GrayImage shown_left, shown_fisheye;
  std::vector<MethodResult> methods;
};

struct Study {
  std::vector<SequenceResult> sequences;
  std::vector<std::string> missing;  // methods that OpenCV lacks, one line each
};

// A line of the table.
struct StudyScores {
  double auc_rotation = 0;     // 0..1
  double auc_translation = 0;  // 0..1
  double mean_inliers = 0;
  double ms_per_image = 0;  // median of the CPU time: detection and description
  double ms_per_match = 0;  // likewise
};
StudyScores scores_of(const MethodResult& method, StudyModel model);

// Runs the study; one thread. Warnings go to the log. Throws InputError, before any work, for a
// dataset or a network that cannot be used; OutputError if `out` cannot be written to.
Study run_study(const StudyOptions& options);

}  // namespace hybrid_slam
