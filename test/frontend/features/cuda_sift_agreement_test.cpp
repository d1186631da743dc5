// The two engines on real images: the kernels of the CUDA engine, run on the host, and the CPU's.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include "frontend/features/cpu/cpu_sift.h"
#include "test/frontend/features/feature_agreement.h"
#include "test/frontend/features/host_cuda_sift.h"
#include "test/frontend/features/sift_quality.h"

namespace hybrid_slam {
namespace {

std::optional<std::string> shared_data() {
  const char* folder = std::getenv("HYBRID_SLAM_DATA");
  if (folder) return std::string(folder) + "/";
  std::cout << "SKIPPED: HYBRID_SLAM_DATA is not set\n";
  return std::nullopt;
}

// Keeps what an engine finds in one image after the other.
template <typename Engine>
class Recorded final : public SiftExtractor {
 public:
  explicit Recorded(const SiftOptions& options) : engine_(options) {}

  FeatureSet extract(const GrayImage& image, const GrayImage* mask) override {
    sets.push_back(engine_.extract(image, mask));
    return sets.back();
  }

  std::vector<FeatureSet> sets;

 private:
  Engine engine_;
};

// Every one of `images`; the worst is printed where this fails.
void check_sets_agree(const std::vector<FeatureSet>& ours, const std::vector<FeatureSet>& cpu,
                      std::size_t images) {
  REQUIRE(ours.size() == images);
  REQUIRE(cpu.size() == images);
  FeatureAgreement worst;
  for (std::size_t i = 0; i < images; ++i) {
    INFO("image " << i << ", features " << ours[i].size() << " and " << cpu[i].size());
    CHECK(cpu[i].size() > 20);
    for (const FeatureAgreement& agreement :
         {feature_agreement(cpu[i], ours[i]), feature_agreement(ours[i], cpu[i])}) {
      CHECK(agreement.found >= 0.98);
      CHECK(agreement.median_angle <= 0.1);
      CHECK(agreement.median_descriptor_angle <= 0.2);
      worst.found = std::min(worst.found, agreement.found);
      worst.median_descriptor_angle =
          std::max(worst.median_descriptor_angle, agreement.median_descriptor_angle);
    }
  }
  std::cout << images << " images: at least " << worst.found << " found, descriptors "
            << worst.median_descriptor_angle << " deg apart at most\n";
}

void check_inliers_agree(const PairQuality& ours, const PairQuality& cpu, double least) {
  std::cout << "correct matches " << ours.correct << " and " << cpu.correct << '\n';
  CHECK(cpu.correct > least);
  CHECK(std::abs(ours.correct - cpu.correct) <= 0.02 * cpu.correct);
  CHECK(std::abs(ours.matches - cpu.matches) <= 0.02 * cpu.matches);
}

TEST_CASE("Rendered reef: CUDA's SIFT finds what the CPU's finds, and matches as many") {
  const auto data = shared_data();
  if (!data) return;
  SiftOptions options;
  options.upsample = false;
  Recorded<HostCudaSift> ours(options);
  Recorded<CpuSift> cpu(options);
  const std::string folder = *data + "uwsynth/hybrid/H1";
  const PairQuality stereo = stereo_pairs(ours, folder, 60).sum;
  const PairQuality stereo_cpu = stereo_pairs(cpu, folder, 60).sum;
  check_sets_agree(ours.sets, cpu.sets, 4);
  check_inliers_agree(stereo, stereo_cpu, 200);
}

TEST_CASE("Seafloor: CUDA's SIFT finds what the CPU's finds, and matches as many", "[slow]") {
  const auto data = shared_data();
  if (!data) return;
  Recorded<HostCudaSift> ours(SiftOptions{});
  Recorded<CpuSift> cpu(SiftOptions{});
  const std::string folder = *data + "underwater_images";
  PairQuality warped, warped_cpu;
  for (const QualityRow& row : warped_copies(ours, folder, 6)) warped += row.sum;
  for (const QualityRow& row : warped_copies(cpu, folder, 6)) warped_cpu += row.sum;
  check_sets_agree(ours.sets, cpu.sets, 6 * 11);
  check_inliers_agree(warped, warped_cpu, 2000);
  CHECK(std::abs(warped.repeated - warped_cpu.repeated) <= 0.02 * warped_cpu.repeated);
}

}  // namespace
}  // namespace hybrid_slam
