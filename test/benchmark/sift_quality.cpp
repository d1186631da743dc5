// Our SIFT against OpenCV's on the shared data, at equal settings: how many features repeat in
// warped copies of images and how many match at the right place, by kind of warp, and between the
// images of stereo pairs. One argument: the folder of the data; the second, if there is one, how
// many images (default 54).
#include <cstdlib>
#include <iomanip>
#include <iostream>
#include <memory>
#include <string>

#include "apps/feature_eval/opencv_sift.h"
#include "frontend/features/cpu/cpu_sift.h"
#include "test/frontend/features/sift_quality.h"

namespace hybrid_slam {
namespace {

struct Engine {
  std::string name;
  std::unique_ptr<SiftExtractor> sift;
};

std::vector<QualityRow> rows_of(const Engine& engine, const std::string& data, int count) {
  auto rows = warped_copies(*engine.sift, data + "/underwater_images", count);
  PairQuality all;
  for (const QualityRow& row : rows) all += row.sum;
  rows.push_back({"all warps", rows.front().pairs, all});
  rows.push_back(stereo_pairs(*engine.sift, data + "/uwsynth/hybrid/H1", 8));
  return rows;
}

void print(const std::vector<QualityRow>& rows, const std::vector<QualityRow>* reference) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const PairQuality& q = rows[i].sum;
    const double pairs = rows[i].pairs;
    std::cout << "| " << std::left << std::setw(18) << rows[i].kind << std::right << std::fixed
              << std::setprecision(0) << " | " << std::setw(5) << q.features / pairs / 2 << " | "
              << std::setprecision(3) << (q.visible > 0 ? q.repeated / q.visible : 0) << " | "
              << std::setprecision(1) << std::setw(6) << q.correct / pairs << " | "
              << std::setprecision(3) << q.correct / q.matches << " | " << q.error / q.correct;
    if (reference != nullptr) {
      const PairQuality& r = (*reference)[i].sum;
      std::cout << " | " << (q.visible > 0 ? q.repeated / q.visible / (r.repeated / r.visible) : 0)
                << " | " << q.correct / r.correct;
    }
    std::cout << " |\n";
  }
}

int run(const std::string& data, int count) {
  SiftOptions plain;
  plain.upsample = false;
  Engine engines[] = {{"OpenCV, upsampled", make_opencv_sift({})},
                      {"ours, upsampled", std::make_unique<CpuSift>(SiftOptions{})},
                      {"OpenCV, without its upsampled octave", make_opencv_sift(plain)},
                      {"ours, not upsampled", std::make_unique<CpuSift>(plain)}};
  std::vector<QualityRow> reference;
  for (int i = 0; i < 4; ++i) {
    std::cout << "\n"
              << engines[i].name
              << "\n\n| pairs | features | repeated | correct | precision | error px |"
              << (i > 0 ? " repeated : OpenCV | correct : OpenCV |" : "") << "\n";
    const std::vector<QualityRow> rows = rows_of(engines[i], data, count);
    print(rows, i % 2 == 1 || i == 2 ? &reference : nullptr);
    std::cout << std::flush;
    if (i == 0 || i == 2) reference = rows;
  }
  return 0;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "usage: sift_quality DATA [IMAGES]\n";
    return 2;
  }
  return hybrid_slam::run(argv[1], argc > 2 ? std::atoi(argv[2]) : 54);
}
