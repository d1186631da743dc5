#include <map>
#include <regex>

#include <catch2/catch.hpp>

#include "apps/pipeline/slam_options.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

// The YAML block of docs/options.md.
std::string documented_options() {
  const std::string text = read_text(SOURCE_FOLDER "/docs/options.md");
  const std::string fence = "```yaml\n";
  const std::size_t begin = text.find(fence);
  REQUIRE(begin != std::string::npos);
  const std::size_t end = text.find("```", begin + fence.size());
  REQUIRE(end != std::string::npos);
  return text.substr(begin + fence.size(), end - begin - fence.size());
}

// How often each word occurs as the first group of `pattern`.
std::map<std::string, int> count_words(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  std::map<std::string, int> counts;
  for (std::sregex_iterator at(text.begin(), text.end(), regex), end; at != end; ++at) {
    ++counts[(*at)[1]];
  }
  return counts;
}

SlamOptions read_documented() {
  const TempFolder folder;
  write_text(folder.path() / "options.yaml", documented_options());
  return read_slam_options((folder.path() / "options.yaml").string());
}

TEST_CASE("docs/options.md lists every key that is read, and no other") {
  const std::string source = read_text(SOURCE_FOLDER "/apps/pipeline/slam_options.cpp");
  const auto read = count_words(source, "(?:field|section|choice)\\(\"([a-z0-9_]+)\"");
  CHECK(read.size() > 40);
  CHECK(count_words(documented_options(), "(?:^|\\n) *([a-z0-9_]+):") == read);
}

TEST_CASE("docs/options.md gives the defaults") {
  const SlamOptions documented = read_documented();
  const SlamOptions defaults;
#define SAME(option) CHECK(documented.option == defaults.option)
  SAME(features);
  SAME(seed);
  SAME(sift.octave_layers);
  SAME(sift.contrast_threshold);
  SAME(sift.edge_threshold);
  SAME(sift.initial_sigma);
  SAME(sift.upsample);
  SAME(sift.keypoint_sigma);
  SAME(stereo.max_row_difference);
  SAME(stereo.min_disparity);
  SAME(stereo.max_descriptor_distance);
  SAME(stereo.ratio);
  SAME(stereo.refine);
  SAME(stereo.alignment.horizontal_only);
  SAME(stereo.alignment.half_size);
  SAME(tracking.min_initial_share);
  SAME(tracking.close_baselines);
  SAME(tracking.min_new_points);
  SAME(tracking.last_frame_radius);
  SAME(tracking.last_frame_retry_share);
  SAME(tracking.last_frame_min_share);
  SAME(tracking.min_reference_matches);
  SAME(tracking.min_pose_inliers);
  SAME(tracking.local_map_radius);
  SAME(tracking.min_local_map_inliers);
  SAME(tracking.min_odometer_inliers);
  SAME(tracking.odometer.ransac_iterations);
  SAME(tracking.odometer.inlier_threshold);
  SAME(tracking.odometer.min_inliers);
  SAME(tracking.odometer.max_gauss_newton_iterations);
  SAME(tracking.disparity.enabled);
  SAME(tracking.disparity.prior_sigma);
  SAME(tracking.disparity.min_significance);
  SAME(tracking.disparity.min_matches);
  SAME(tracking.keyframes.min_tracked_ratio);
  SAME(tracking.keyframes.min_tracked_ratio_young);
  SAME(tracking.keyframes.min_inliers);
  SAME(tracking.keyframes.min_close_tracked);
  SAME(tracking.keyframes.min_close_untracked);
  SAME(tracking.keyframes.max_frames_between);
  SAME(tracking.keyframes.min_motion);
  SAME(tracking.refinement.enabled);
  SAME(tracking.refinement.keyframes);
  SAME(tracking.refinement.sigma);
  SAME(tracking.refinement.max_view_angle_deg);
  SAME(tracking.matcher.max_descriptor_distance);
  SAME(tracking.matcher.ratio);
  SAME(tracking.matcher.max_scale_ratio);
  SAME(tracking.matcher.max_view_angle_deg);
  SAME(tracking.relocalization.max_keyframes);
  SAME(tracking.relocalization.ratio);
  SAME(tracking.relocalization.min_matches);
  SAME(tracking.relocalization.min_inliers);
  SAME(triangulation.stereo_neighbours);
  SAME(triangulation.mono_neighbours);
  SAME(triangulation.min_baseline_ratio);
  SAME(triangulation.max_parallax_cosine);
  SAME(triangulation.max_descriptor_distance);
  SAME(triangulation.ratio);
  SAME(triangulation.epipolar_sigmas);
  SAME(triangulation.max_scale_ratio);
  SAME(fusion.neighbours);
  SAME(fusion.second_neighbours);
  SAME(fusion.radius);
  SAME(fusion.max_descriptor_distance);
  SAME(fusion.max_scale_ratio);
  SAME(culling.min_found_ratio);
  SAME(culling.min_observations);
  SAME(culling.probation);
  SAME(culling.redundant_share);
  SAME(culling.redundant_observers);
  SAME(culling.close_baselines);
  SAME(backend.local_method);
  SAME(backend.incremental.solver.window);
  SAME(backend.incremental.solver.budget);
#undef SAME
}

TEST_CASE("written options are read again exactly, every key of them") {
  SlamOptions options;
  options.features = 1234;
  options.seed = ~std::uint64_t{0};
  options.stereo.ratio = 1.0 / 3;
  options.sift.upsample = false;
  options.tracking.refinement.sigma = 0.1;
  options.backend.local_method = LocalMethod::kBundle;
  const std::string text = write_slam_options(options);
  const TempFolder folder;
  write_text(folder.path() / "options.yaml", text);
  const SlamOptions read = read_slam_options((folder.path() / "options.yaml").string());
  CHECK(read.features == 1234);
  CHECK(read.seed == ~std::uint64_t{0});
  CHECK(read.stereo.ratio == 1.0 / 3);
  CHECK_FALSE(read.sift.upsample);
  CHECK(read.backend.local_method == LocalMethod::kBundle);
  CHECK(write_slam_options(read) == text);
  const std::string keys = "(?:^|\\n) *([a-z0-9_]+):";
  CHECK(count_words(text, keys) == count_words(documented_options(), keys));
}

}  // namespace
}  // namespace hybrid_slam
