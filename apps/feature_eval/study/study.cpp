#include "apps/feature_eval/study/study.h"

#include <algorithm>
#include <ctime>
#include <set>
#include <stdexcept>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "apps/feature_eval/methods/method_choice.h"
#include "apps/feature_eval/study/error_curve.h"
#include "apps/feature_eval/study/study_files.h"
#include "apps/feature_eval/study/study_sequence.h"
#include "apps/feature_eval/study/view_geometry.h"
#include "apps/io/progress_line.h"
#include "apps/io/report.h"

namespace hybrid_slam {
namespace {

std::vector<StudySequence> open_all(const StudyOptions& options) {
  std::vector<StudySequence> sequences;
  for (const std::string& dataset : options.datasets) {
    sequences.emplace_back(dataset, options.every, options.masks);
  }
  return sequences;
}

// When all is known to be usable: what is refused ends in one line.
void tell_warnings(const std::vector<StudySequence>& sequences, const Study& study) {
  for (const StudySequence& sequence : sequences) {
    for (const std::string& warning : sequence.warnings()) spdlog::warn("{}", warning);
  }
  for (const std::string& line : study.missing) spdlog::warn("{}", line);
}

// A second sequence of a name is numbered.
std::vector<SequenceResult> empty_results(const std::vector<StudySequence>& sequences,
                                          const std::vector<NamedMethod>& methods) {
  std::vector<SequenceResult> results;
  std::set<std::string> taken;
  for (const StudySequence& sequence : sequences) {
    SequenceResult& result = results.emplace_back();
    result.name = sequence.name();
    for (int i = 2; !taken.insert(result.name).second; ++i) {
      result.name = fmt::format("{}_{}", sequence.name(), i);
    }
    for (const NamedMethod& method : methods) result.methods.emplace_back().name = method.name;
  }
  return results;
}

struct Correspondences {
  MatchedBearings bearings;
  std::vector<FeatureMatch> matches;  // of which both pixels have a ray
};

Correspondences correspond(const StudySequence& sequence, const DescribedFeatures& left,
                           const DescribedFeatures& fisheye,
                           const std::vector<FeatureMatch>& matches) {
  Correspondences found;
  for (const FeatureMatch& match : matches) {
    const Keypoint& a = left.keypoints[static_cast<std::size_t>(match.query)];
    const Keypoint& b = fisheye.keypoints[static_cast<std::size_t>(match.train)];
    const auto ray_a = unproject(sequence.left_camera(), Eigen::Vector2d(a.x, a.y));
    const auto ray_b = unproject(sequence.fisheye_camera(), Eigen::Vector2d(b.x, b.y));
    if (!ray_a || !ray_b) continue;
    found.bearings.a.push_back(*ray_a);
    found.bearings.b.push_back(*ray_b);
    found.matches.push_back(match);
  }
  return found;
}

// As OpenCV does for cameras of two focal lengths.
ConsensusOptions consensus_options(const StudySequence& sequence, double threshold_px) {
  const double focal =
      (focal_length(sequence.left_camera()) + focal_length(sequence.fisheye_camera())) / 2;
  ConsensusOptions options;
  options.threshold = threshold_px / focal;
  return options;
}

MotionErrors errors_of(const std::optional<ViewMotion>& motion, const Rigid3d& truth) {
  if (!motion) return {};
  return {motion->inliers, rotation_error_deg(motion->a_from_b, truth),
          direction_error_deg(motion->a_from_b, truth)};
}

// All threads'; there is one.
double cpu_milliseconds() { return 1000.0 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double median_of(const std::vector<double>& times) {
  return times.empty() ? 0 : percentile(times, 50);
}

void study_pair(FeatureMethod& method, const StudySequence& sequence, const StudyPair& pair,
                const StudyOptions& options, bool shown, MethodResult& result) {
  StageTimes by_the_clock;  // which tells what else the machine did, too
  const auto extract = [&](const GrayImage& image, const std::optional<GrayImage>& mask) {
    const double start = cpu_milliseconds();
    DescribedFeatures features = method.extract(image, mask ? &*mask : nullptr, by_the_clock);
    result.image_times.push_back(cpu_milliseconds() - start);
    return features;
  };
  const DescribedFeatures left = extract(pair.left, pair.left_mask);
  const DescribedFeatures fisheye = extract(pair.fisheye, pair.fisheye_mask);
  const double start = cpu_milliseconds();
  const auto matches = method.match(left, fisheye, by_the_clock);
  result.match_times.push_back(cpu_milliseconds() - start);
  const Correspondences found = correspond(sequence, left, fisheye, matches);
  const ConsensusOptions consensus = consensus_options(sequence, options.threshold);
  const auto on_plane = motion_on_plane(found.bearings, consensus);
  const auto on_bearings = motion_on_bearings(found.bearings, consensus);
  result.pairs.push_back({pair.frame,
                          left.size(),
                          fisheye.size(),
                          matches.size(),
                          {errors_of(on_plane, pair.left_from_fisheye),
                           errors_of(on_bearings, pair.left_from_fisheye)}});
  if (!shown) return;
  result.shown.clear();
  for (std::size_t i = 0; i < found.matches.size(); ++i) {
    const FeatureMatch& match = found.matches[i];
    result.shown.push_back({left.keypoints[static_cast<std::size_t>(match.query)],
                            fisheye.keypoints[static_cast<std::size_t>(match.train)],
                            on_plane && on_plane->inlier[i] != 0});
  }
}

void study_sequence(const StudySequence& sequence, std::vector<NamedMethod>& methods,
                    const StudyOptions& options, ProgressLine& progress, SequenceResult& result) {
  const std::size_t middle = sequence.frames()[sequence.frames().size() / 2];
  std::size_t done = 0;
  for (const std::size_t frame : sequence.frames()) {
    progress.update(done++, sequence.frames().size(), result.name);
    std::optional<StudyPair> pair;
    try {
      pair = sequence.read(frame);
    } catch (const InputError& error) {
      spdlog::warn("{}: frame {} is left out: {}", result.name, frame, error.what());
      continue;
    }
    const bool shown = frame <= middle || result.shown_left.empty();  // the last one that stays
    for (std::size_t i = 0; i < methods.size(); ++i) {
      study_pair(*methods[i].method, sequence, *pair, options, shown, result.methods[i]);
    }
    if (!shown) continue;
    result.shown_frame = frame;
    result.shown_left = std::move(pair->left);
    result.shown_fisheye = std::move(pair->fisheye);
  }
  if (result.methods.front().pairs.empty()) {
    throw InputError(sequence.name() + ": no image of the chosen frames can be read");
  }
}

}  // namespace

StudyScores scores_of(const MethodResult& method, StudyModel model) {
  StudyScores scores;
  std::vector<double> rotations, directions;
  for (const PairResult& pair : method.pairs) {
    const MotionErrors& motion = pair.motion[static_cast<std::size_t>(model)];
    rotations.push_back(motion.rotation_deg);
    directions.push_back(motion.direction_deg);
    scores.mean_inliers +=
        static_cast<double>(motion.inliers) / static_cast<double>(method.pairs.size());
  }
  scores.auc_rotation = area_under_curve(rotations);
  scores.auc_translation = area_under_curve(directions);
  scores.ms_per_image = median_of(method.image_times);
  scores.ms_per_match = median_of(method.match_times);
  return scores;
}

Study run_study(const StudyOptions& options) {
  Study study;
  const std::vector<StudySequence> sequences = open_all(options);
  std::vector<NamedMethod> methods = make_methods(options.methods, options.sift, study.missing);
  if (methods.empty()) throw std::logic_error("a study without methods");
  prepare_study_folder(options.out);
  tell_warnings(sequences, study);
  study.sequences = empty_results(sequences, methods);
  ProgressLine progress("pairs", false);
  for (std::size_t i = 0; i < sequences.size(); ++i) {
    study_sequence(sequences[i], methods, options, progress, study.sequences[i]);
  }
  progress.finish();
  return study;
}

}  // namespace hybrid_slam
