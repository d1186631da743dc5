#include "apps/feature_eval/evaluation.h"

#include <filesystem>
#include <iterator>
#include <set>

#include <fmt/format.h>

#include "apps/feature_eval/pictures.h"
#include "apps/slam/parallel_for.h"
#include "cameras/files/output_file.h"
#include "frontend/input/image_file.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

struct FeatureImage {
  GrayImage image;
  DescribedFeatures features;
};

// The file names without folder and ending; those that were there before are numbered.
std::vector<std::string> result_names(const std::vector<std::string>& images) {
  std::vector<std::string> names;
  std::set<std::string> taken;
  for (const std::string& image : images) {
    const std::string stem = fs::path(image).stem().string();
    std::string name = stem;
    for (int i = 2; !taken.insert(name).second; ++i) name = fmt::format("{}_{}", stem, i);
    names.push_back(name);
  }
  return names;
}

void write_keypoints(const fs::path& path, const std::vector<Keypoint>& keypoints) {
  std::string csv = "x,y,scale,angle,response\n";
  for (const Keypoint& k : keypoints) {
    fmt::format_to(std::back_inserter(csv), "{},{},{},{},{}\n", k.x, k.y, k.scale, k.angle,
                   k.response);
  }
  write_file(path, csv);
}

void write_matches(const fs::path& path, const DescribedFeatures& first,
                   const DescribedFeatures& second, const std::vector<FeatureMatch>& matches) {
  std::string csv = "query,train,x1,y1,x2,y2,distance\n";
  for (const FeatureMatch& match : matches) {
    const Keypoint& a = first.keypoints[static_cast<std::size_t>(match.query)];
    const Keypoint& b = second.keypoints[static_cast<std::size_t>(match.train)];
    fmt::format_to(std::back_inserter(csv), "{},{},{},{},{},{},{:.5f}\n", match.query, match.train,
                   a.x, a.y, b.x, b.y, match.distance);
  }
  write_file(path, csv);
}

// One method per worker, since an instance serves one thread.
class Methods {
 public:
  explicit Methods(const CommandLine& line) : line_(line) {
    for (int i = 0; i < line.threads; ++i) {
      methods_.push_back(make_sift_method(line.engine, line.sift));
    }
  }

  FeatureImage extract(std::size_t worker, ExtractionResult& result) {
    FeatureImage found;
    found.image = read_gray_image(result.image);
    for (int i = 0; i < line_.repeat; ++i) {
      found.features = methods_[worker]->extract(found.image, nullptr, result.times);
    }
    result.width = found.image.width;
    result.height = found.image.height;
    result.keypoints = found.features.size();
    return found;
  }

  std::vector<FeatureMatch> match(std::size_t worker, const FeatureImage& first,
                                  const FeatureImage& second, MatchResult& result) {
    std::vector<FeatureMatch> matches;
    for (int i = 0; i < line_.repeat; ++i) {
      matches = methods_[worker]->match(first.features, second.features, result.times);
    }
    result.matches = matches.size();
    return matches;
  }

 private:
  const CommandLine& line_;
  std::vector<std::unique_ptr<FeatureMethod>> methods_;
};

void extract_all(const CommandLine& line, Methods& methods, Evaluation& evaluation) {
  const std::vector<std::string> names = result_names(line.images);
  parallel_for(line.images.size(), line.threads, [&](std::size_t i, std::size_t worker) {
    const FeatureImage found = methods.extract(worker, evaluation.images[i]);
    const std::string path = (fs::path(line.out) / names[i]).string() + "_keypoints";
    write_keypoints(path + ".csv", found.features.keypoints);
    write_keypoint_picture(path + ".png", found.image, found.features.keypoints);
  });
}

void match_all(const CommandLine& line, Methods& methods, Evaluation& evaluation) {
  const std::vector<std::string> names = result_names(line.images);
  std::vector<FeatureImage> found(line.images.size());
  parallel_for(found.size(), line.threads, [&](std::size_t i, std::size_t worker) {
    found[i] = methods.extract(worker, evaluation.images[i]);
  });
  evaluation.pairs.resize(found.size() - 1);
  parallel_for(evaluation.pairs.size(), line.threads, [&](std::size_t i, std::size_t worker) {
    MatchResult& pair = evaluation.pairs[i];
    const FeatureImage& first = found.front();
    const FeatureImage& second = found[i + 1];
    pair.first = line.images.front();
    pair.second = line.images[i + 1];
    const auto matches = methods.match(worker, first, second, pair);
    const std::string path =
        (fs::path(line.out) / (names.front() + "_" + names[i + 1])).string() + "_matches";
    write_matches(path + ".csv", first.features, second.features, matches);
    write_match_picture(path + ".png", first.image, first.features.keypoints, second.image,
                        second.features.keypoints, matches);
  });
}

}  // namespace

Evaluation evaluate(const CommandLine& line) {
  Evaluation evaluation;
  for (const std::string& image : line.images) {
    read_image_size(image);  // throws if it cannot be read
    evaluation.images.emplace_back().image = image;
  }
  make_folder(line.out);
  if (!line.json.empty()) write_file(line.json, "{}\n");
  Methods methods(line);
  if (line.command == EvalCommand::kExtract) {
    extract_all(line, methods, evaluation);
  } else {
    match_all(line, methods, evaluation);
  }
  return evaluation;
}

}  // namespace hybrid_slam
