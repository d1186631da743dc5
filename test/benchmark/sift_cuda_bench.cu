// Times of SIFT and of its matchers on the device:
//   sift_cuda_bench [IMAGE.pgm...] [--json FILE]
// Without images it makes some. Medians of milliseconds: "device" by events around the kernels, as
// they run otherwise, upload and download apart; "total" on the clock of the host from the image in
// memory to the features in memory; stages by events, kernels launched one by one, so that their
// sum exceeds "device". Exit code 0: done, 1: an error, 2: bad usage, 77: no CUDA device.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "frontend/features/cuda/cuda_sift.h"
#include "frontend/matching/cuda/cuda_matcher.h"
#include "test/frontend/cuda/program_images.h"

namespace hybrid_slam::cuda {
namespace {

constexpr int kRuns = 50;

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<int>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

template <typename Run>
double median_of_clock(const Run& run) {
  std::vector<double> times;
  for (int i = 0; i < kRuns; ++i) {
    const auto start = std::chrono::steady_clock::now();
    run();
    const std::chrono::duration<double, std::milli> time = std::chrono::steady_clock::now() - start;
    times.push_back(time.count());
  }
  return median(times);
}

struct Row {
  std::string name;
  std::size_t found = 0;  // features or matches
  double device = 0;      // kernels alone [ms]; 0: not measured
  double total = 0;       // [ms]
  std::size_t bytes = 0;  // of the device's memory that an extractor holds
  CudaStageTimes stages;
};

// Medians of the stages of several runs.
template <typename Timed, typename Run>
CudaStageTimes median_of_stages(Timed& timed, CudaTiming timing, const Run& run) {
  timed.time(timing);
  std::vector<std::string> names;
  std::vector<std::vector<double>> times;
  for (int i = 0; i < kRuns; ++i) {
    run();
    names.clear();
    std::size_t k = 0;
    for (const auto& [name, time] : timed.stage_times()) {
      names.push_back(name);
      times.resize(std::max(times.size(), ++k));
      times[k - 1].push_back(time);
    }
  }
  timed.time(CudaTiming::kOff);
  CudaStageTimes medians;
  for (std::size_t k = 0; k < names.size(); ++k) medians.emplace_back(names[k], median(times[k]));
  return medians;
}

double time_of(const CudaStageTimes& stages, const std::string& name) {
  double sum = 0;
  for (const auto& [stage, time] : stages) sum += stage == name ? time : 0;
  return sum;
}

SiftOptions options_for(int features, bool upsample) {
  SiftOptions options;
  options.max_features = features;
  options.upsample = upsample;
  return options;
}

Row bench_extraction(const std::string& name, const GrayImage& image, int features, bool upsample) {
  CudaSift sift(options_for(features, upsample));
  const auto run = [&] { return sift.extract(image, nullptr).size(); };
  Row row;
  row.name = name + " " + std::to_string(image.width) + "x" + std::to_string(image.height) +
             (upsample ? " upsampled" : "") + " N=" + std::to_string(features);
  row.found = run();
  row.bytes = sift.device_bytes();
  row.total = median_of_clock(run);
  row.device = time_of(median_of_stages(sift, CudaTiming::kWhole, run), "kernels");
  row.stages = median_of_stages(sift, CudaTiming::kStages, run);
  return row;
}

Row bench_match(const GrayImage& a, const GrayImage& b) {
  CudaSift sift(options_for(4000, true));
  CudaFeatures query, train;
  sift.extract(a, nullptr);
  query.assign(sift);
  sift.extract(b, nullptr);
  train.assign(sift);
  CudaMatcher matcher;
  const BruteForceOptions options{.ratio = 0.8};
  const auto run = [&] { return matcher.match(query, train, options).size(); };
  Row row;
  row.name = "match " + std::to_string(query.size()) + "x" + std::to_string(train.size());
  row.found = run();
  row.total = median_of_clock(run);
  row.stages = median_of_stages(matcher, CudaTiming::kWhole, run);
  row.device = time_of(row.stages, "match");
  return row;
}

// Two images up, two extractions, and a circular match with the frame before.
Row bench_stereo_step(const GrayImage& left, const GrayImage& right) {
  CudaSift sifts[2] = {CudaSift(options_for(4000, false)), CudaSift(options_for(4000, false))};
  CudaMatcher matcher;
  CudaStereoFeatures previous, current;
  std::size_t circles = 0;
  const auto step = [&] {
    sifts[0].start(left, nullptr);
    sifts[1].start(right, nullptr);
    const std::size_t lefts = sifts[0].finish().size();
    const std::size_t rights = sifts[1].finish().size();
    current.left.assign(sifts[0]);
    current.right.assign(sifts[1]);
    current.right_of_left.assign(lefts, -1);
    for (std::size_t i = 0; i < std::min(lefts, rights); ++i) {
      current.right_of_left[i] = static_cast<int>(i);
    }
    circles = matcher.match_circular(previous, current, 0.9).size();
    std::swap(previous, current);
  };
  step();
  step();
  Row row;
  row.name = "stereo step " + std::to_string(left.width) + "x" + std::to_string(left.height);
  row.total = median_of_clock(step);
  row.found = circles;
  return row;
}

void print(const Row& row) {
  std::printf("%s: %zu found, device %.4f ms, total %.4f ms, memory %.1f MB\n", row.name.c_str(),
              row.found, row.device, row.total, static_cast<double>(row.bytes) / 1e6);
  for (const auto& [stage, time] : row.stages) std::printf("  %-12s %.4f\n", stage.c_str(), time);
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

void write_json(const std::string& name, const std::vector<Row>& rows) {
  std::ostringstream json;
  json << "[";
  for (const Row& row : rows) {
    json << (&row == rows.data() ? "\n" : ",\n") << "{\"name\": " << quoted(row.name)
         << ", \"found\": " << row.found << ", \"device_ms\": " << row.device
         << ", \"total_ms\": " << row.total << ", \"device_bytes\": " << row.bytes
         << ", \"stages\": {";
    for (const auto& stage : row.stages) {
      json << (&stage == row.stages.data() ? "" : ", ") << quoted(stage.first) << ": "
           << stage.second;
    }
    json << "}}";
  }
  json << "\n]\n";
  std::ofstream file(name);
  file << json.str();
  if (!file.flush()) throw std::runtime_error(name + ": cannot be written");
}

int run(int argc, char** argv) {
  std::vector<std::string> names;
  std::string json;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const bool is_json = argument == "--json";
    if (argument.starts_with("-") && !(is_json && i + 1 < argc)) {
      std::fprintf(stderr, "usage: sift_cuda_bench [IMAGE.pgm...] [--json FILE]\n");
      return 2;
    }
    if (is_json) {
      json = argv[++i];
    } else {
      names.push_back(argument);
    }
  }
  if (const std::string why = why_no_cuda(); !why.empty()) {
    std::printf("%s\n", why.c_str());
    return 77;
  }
  std::vector<Row> rows;
  const auto add = [&](Row row) {
    print(row);
    rows.push_back(std::move(row));
  };
  for (const std::string& name : names) {
    const GrayImage image = read_pgm(name);
    for (const bool upsample : {false, true}) {
      add(bench_extraction(name, image, 4000, upsample));
    }
  }
  const GrayImage left = made_image(1355, 1002, 1);
  const GrayImage right = made_image(1355, 1002, 1, -5);
  if (names.empty()) {
    add(bench_extraction("made", left, 4000, false));
    add(bench_extraction("made", left, 4000, true));
    add(bench_extraction("made", made_image(1920, 1080, 2), 8000, false));
    add(bench_extraction("made", made_image(1280, 960, 3), 2000, false));
  }
  add(bench_match(left, right));
  add(bench_stereo_step(left, right));
  if (!json.empty()) write_json(json, rows);
  return 0;
}

}  // namespace
}  // namespace hybrid_slam::cuda

int main(int argc, char** argv) {
  try {
    return hybrid_slam::cuda::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
