#include "apps/slam/slam_options.h"

#include <yaml-cpp/yaml.h>

#include <optional>
#include <set>
#include <type_traits>
#include <utility>
#include <vector>

#include "cameras/files/yaml_section.h"

namespace hybrid_slam {
namespace {

// One mapping of the file: every key that fields_of() names may appear in it, and no other. Empty
// where the file has none.
class Section {
 public:
  explicit Section(std::optional<YamlSection> yaml) : yaml_(std::move(yaml)) {}

  template <typename T>
  Section& field(const char* key, T& value) {
    known_.insert(key);
    if (yaml_ && yaml_->has(key)) {
      if constexpr (std::is_same_v<T, std::string>) {
        value = yaml_->text(key);
      } else {
        value = yaml_->value<T>(key);
      }
    }
    return *this;
  }

  // One of several words.
  template <typename T>
  Section& choice(const char* key, const std::vector<std::pair<std::string, T>>& words, T& value) {
    known_.insert(key);
    if (!yaml_ || !yaml_->has(key)) return *this;
    const std::string wanted = yaml_->text(key);
    std::string list;
    for (const auto& [word, meaning] : words) {
      if (word == wanted) {
        value = meaning;
        return *this;
      }
      list += (list.empty() ? "" : ", ") + word;
    }
    yaml_->fail(key, "is none of " + list);
  }

  Section section(const char* key) {
    known_.insert(key);
    return Section(yaml_ && yaml_->has(key) ? std::optional(yaml_->child(key)) : std::nullopt);
  }

  void refuse_unknown() const {
    if (yaml_) yaml_->refuse_all_but(known_);
  }

 private:
  std::optional<YamlSection> yaml_;
  std::set<std::string> known_;
};

// The same, to be written: takes the value of every field.
class WrittenSection {
 public:
  explicit WrittenSection(const YAML::Node& node) : node_(node) {}

  template <typename T>
  WrittenSection& field(const char* key, const T& value) {
    node_[key] = value;
    return *this;
  }

  template <typename T>
  WrittenSection& choice(const char* key, const std::vector<std::pair<std::string, T>>& words,
                         const T& value) {
    for (const auto& [word, meaning] : words) {
      if (meaning == value) node_[key] = word;
    }
    return *this;
  }

  WrittenSection section(const char* key) {
    const YAML::Node below(YAML::NodeType::Map);
    node_[key] = below;
    return WrittenSection(below);
  }

  void refuse_unknown() const {}

 private:
  YAML::Node node_;  // shares its content with those it was copied from
};

// What there is to be set, for both kinds of section.
template <typename S>
void fields_of(S section, SiftOptions& options, Upsampling& upsampling) {
  section.field("octave_layers", options.octave_layers)
      .field("contrast_threshold", options.contrast_threshold)
      .field("edge_threshold", options.edge_threshold)
      .field("initial_sigma", options.initial_sigma)
      .choice("upsample",
              {{"auto", Upsampling::kAuto}, {"true", Upsampling::kOn}, {"false", Upsampling::kOff}},
              upsampling)
      .field("keypoint_sigma", options.keypoint_sigma)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, StereoMatcherOptions& options) {
  section.field("max_row_difference", options.max_row_difference)
      .field("min_disparity", options.min_disparity)
      .field("max_descriptor_distance", options.max_descriptor_distance)
      .field("ratio", options.ratio)
      .field("refine", options.refine)
      .field("horizontal_only", options.alignment.horizontal_only)
      .field("patch_half_size", options.alignment.half_size)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, KeyframePolicyOptions& options) {
  section.field("min_overlap", options.min_overlap)
      .field("max_new_ground", options.max_new_ground)
      .field("min_tracked_ratio", options.min_tracked_ratio)
      .field("min_tracked_ratio_young", options.min_tracked_ratio_young)
      .field("min_inliers", options.min_inliers)
      .field("min_close_tracked", options.min_close_tracked)
      .field("min_close_untracked", options.min_close_untracked)
      .field("max_frames_between", options.max_frames_between)
      .field("max_seconds_between", options.max_seconds_between)
      .field("min_motion", options.min_motion)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, StereoOdometerOptions& options) {
  section.field("ransac_iterations", options.ransac_iterations)
      .field("inlier_threshold", options.inlier_threshold)
      .field("min_inliers", options.min_inliers)
      .field("max_gauss_newton_iterations", options.max_gauss_newton_iterations)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, DisparityCalibratorOptions& options) {
  section.field("enabled", options.enabled)
      .field("prior_sigma", options.prior_sigma)
      .field("min_significance", options.min_significance)
      .field("min_matches", options.min_matches)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, ShadingCalibratorOptions& options) {
  section.field("enabled", options.enabled)
      .field("prior_sigma", options.prior_sigma)
      .field("min_significance", options.min_significance)
      .field("min_tracks", options.min_tracks)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, TrackRefinementOptions& options) {
  section.field("enabled", options.enabled)
      .field("keyframes", options.keyframes)
      .field("sigma", options.sigma)
      .field("min_sigma", options.min_sigma)
      .field("max_view_angle_deg", options.max_view_angle_deg)
      .field("patch_half_size", options.alignment.half_size)
      .field("min_correlation", options.alignment.min_correlation)
      .refuse_unknown();
}

// What both trackers have; the caller refuses unknown keys.
template <typename S>
void shared_fields_of(S& section, TrackerOptions& options) {
  fields_of(section.section("refinement"), options.refinement);
  section.section("matcher")
      .field("max_descriptor_distance", options.matcher.max_descriptor_distance)
      .field("ratio", options.matcher.ratio)
      .field("max_scale_ratio", options.matcher.max_scale_ratio)
      .field("max_view_angle_deg", options.matcher.max_view_angle_deg)
      .refuse_unknown();
  section.section("relocalization")
      .field("max_keyframes", options.relocalization.max_keyframes)
      .field("ratio", options.relocalization.ratio)
      .field("min_matches", options.relocalization.min_matches)
      .field("min_inliers", options.relocalization.min_inliers)
      .refuse_unknown();
  section.field("local_map_radius", options.local_map_radius)
      .field("min_local_map_inliers", options.min_local_map_inliers);
}

template <typename S>
void fields_of(S section, StereoTrackerOptions& options) {
  shared_fields_of(section, options);
  fields_of(section.section("keyframes"), options.keyframes);
  fields_of(section.section("odometer"), options.odometer);
  fields_of(section.section("disparity"), options.disparity);
  fields_of(section.section("shading"), options.refinement.shading);
  section.field("new_components", options.new_components)
      .field("moving_regions", options.moving_regions)
      .field("min_initial_share", options.min_initial_share)
      .field("close_baselines", options.close_baselines)
      .field("min_new_points", options.min_new_points)
      .field("last_frame_radius", options.last_frame_radius)
      .field("last_frame_retry_share", options.last_frame_retry_share)
      .field("last_frame_min_share", options.last_frame_min_share)
      .field("min_reference_matches", options.min_reference_matches)
      .field("min_pose_inliers", options.min_pose_inliers)
      .field("min_odometer_inliers", options.min_odometer_inliers)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, FisheyeTrackerOptions& options) {
  shared_fields_of(section, options);
  section.section("keyframes")
      .field("min_tracked_ratio", options.keyframes.min_tracked_ratio)
      .field("min_inliers", options.keyframes.min_inliers)
      .field("max_frames_between", options.keyframes.max_frames_between)
      .field("max_seconds_between", options.keyframes.max_seconds_between)
      .field("min_motion", options.keyframes.min_motion)
      .refuse_unknown();
  section.refuse_unknown();
}

template <typename S>
void fields_of(S section, FisheyeOptions& options) {
  fields_of(section.section("tracking"), options.tracking);
  section.field("upsample", options.upsample)
      .field("max_angle_deg", options.view.max_angle_deg)
      .field("border", options.view.border)
      .field("mask", options.view.mask)
      .field("clahe", options.view.clahe)
      .field("stereo_tracked_ratio", options.stereo_tracked_ratio)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, TriangulationOptions& options) {
  section.field("stereo_neighbours", options.stereo_neighbours)
      .field("mono_neighbours", options.mono_neighbours)
      .field("min_baseline_ratio", options.min_baseline_ratio)
      .field("max_parallax_cosine", options.max_parallax_cosine)
      .field("max_descriptor_distance", options.max_descriptor_distance)
      .field("ratio", options.ratio)
      .field("epipolar_sigmas", options.epipolar_sigmas)
      .field("max_scale_ratio", options.max_scale_ratio)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, FusionOptions& options) {
  section.field("neighbours", options.neighbours)
      .field("second_neighbours", options.second_neighbours)
      .field("radius", options.radius)
      .field("max_descriptor_distance", options.max_descriptor_distance)
      .field("max_scale_ratio", options.max_scale_ratio)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, CullingOptions& options) {
  section.field("min_found_ratio", options.min_found_ratio)
      .field("min_observations", options.min_observations)
      .field("probation", options.probation)
      .field("redundant_share", options.redundancy.share)
      .field("redundant_observers", options.redundancy.observers)
      .field("close_baselines", options.close_baselines)
      .field("full_keyframes", options.full_keyframes)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, MaskOptions& options) {
  section.field("left", options.left).field("right", options.right).refuse_unknown();
}

template <typename S>
void fields_of(S section, LoopOptions& options) {
  LoopDetectorOptions& detector = options.finder.detector;
  LoopVerifierOptions& verifier = options.finder.verifier;
  section.field("enabled", options.enabled)
      .field("min_gap", detector.min_gap)
      .field("max_shared_landmarks", detector.max_shared_landmarks)
      .field("min_word_share", detector.min_word_share)
      .field("min_base_ratio", detector.min_base_ratio)
      .field("min_score_share", detector.min_score_share)
      .field("consistency", detector.consistency)
      .field("max_candidates", detector.max_candidates)
      .field("ratio", verifier.ratio)
      .field("max_descriptor_distance", verifier.max_descriptor_distance)
      .field("min_matches", verifier.min_matches)
      .field("min_inliers", verifier.pose.min_inliers)
      .field("search_radius", verifier.search_radius)
      .field("min_final_matches", verifier.min_final_matches)
      .field("min_found_share", verifier.min_found_share)
      .field("min_confirmations", verifier.min_confirmations)
      .field("surroundings_sigma", verifier.surroundings_sigma)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, FullBundleOptions& options) {
  section.field("enabled", options.enabled)
      .field("max_keyframes", options.max_keyframes)
      .refuse_unknown();
}

template <typename S>
void fields_of(S section, BackendOptions& options) {
  fields_of(section.section("full_bundle"), options.full);
  section
      .choice("method",
              {{"incremental", LocalMethod::kIncremental}, {"bundle", LocalMethod::kBundle}},
              options.local_method)
      .field("window", options.incremental.solver.window)
      .field("budget", options.incremental.solver.budget)
      .field("condense_after", options.incremental.solver.condense_after)
      .refuse_unknown();
}

template <typename S>
void fields_of(S top, SlamOptions& options) {
  fields_of(top.section("sift"), options.sift, options.upsampling);
  fields_of(top.section("stereo"), options.stereo);
  fields_of(top.section("tracking"), options.tracking);
  fields_of(top.section("fisheye"), options.fisheye);
  fields_of(top.section("triangulation"), options.triangulation);
  fields_of(top.section("fusion"), options.fusion);
  fields_of(top.section("culling"), options.culling);
  fields_of(top.section("masks"), options.masks);
  fields_of(top.section("loops"), options.loops);
  fields_of(top.section("backend"), options.backend);
  top.field("features", options.features)
      .field("seed", options.seed)
      .field("align_pair", options.align_pair)
      .refuse_unknown();
}

}  // namespace

void SlamOptions::distribute() {
  sift.max_features = features;
  sift.upsample = upsampling != Upsampling::kOff;
  for (TrackerOptions* tracker :
       {static_cast<TrackerOptions*>(&tracking), static_cast<TrackerOptions*>(&fisheye.tracking)}) {
    tracker->max_features = features;
    tracker->relocalization.ransac.seed = seed;
    tracker->redundancy = culling.redundancy;
  }
  tracking.odometer.seed = seed;
  loops.finder.verifier.pose.seed = seed;
}

std::string SlamOptions::validate() const {
  if (features < 50 || features > 100000) {
    return "features must lie between 50 and 100000";
  }
  if (!(fisheye.stereo_tracked_ratio > 0 && fisheye.stereo_tracked_ratio <= 1)) {
    return "fisheye: stereo_tracked_ratio must lie in (0, 1]";
  }
  for (const std::string& error :
       {sift.validate(), stereo.validate(), tracking.validate(), fisheye.view.validate(),
        fisheye.tracking.validate(), triangulation.validate(), fusion.validate(),
        culling.validate(), loops.finder.validate(), backend.validate()}) {
    if (!error.empty()) {
      return error;
    }
  }
  return {};
}

SlamOptions read_slam_options(const std::string& path) {
  SlamOptions options;
  fields_of(Section(YamlSection::read(path)), options);
  options.distribute();
  const std::string error = options.validate();
  if (!error.empty()) {
    throw InputError(path + ": " + error);
  }
  return options;
}

std::string write_slam_options(SlamOptions options) {
  const YAML::Node root(YAML::NodeType::Map);
  fields_of(WrittenSection(root), options);
  return YAML::Dump(root) + "\n";
}

}  // namespace hybrid_slam
