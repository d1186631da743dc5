#include "apps/feature_eval/command_line.h"

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>

#include "apps/feature_eval/methods/method_choice.h"
#include "apps/feature_eval/methods/opencv_features.h"
#include "apps/program/program.h"

namespace hybrid_slam {
namespace {

constexpr const char* kFooter =
    R"(Writes to DIR, NAME being an image's file name without its ending:
  extract   NAME_keypoints.csv (x,y,scale,angle,response: pixels and radians, the strongest first)
            and NAME_keypoints.png, with a circle of three scales around each
  match     FIRST_NAME_matches.csv (query,train,x1,y1,x2,y2,distance) and .png, for each image after
            the first; matches are mutually nearest and pass the ratio test at 0.8
A second image of a name is NAME_2. FILE: options, and medians of milliseconds ("total_ms", "stages").

Exit codes: 0 done; 1 internal error; 2 bad usage, or an engine that cannot be used here; 3 bad input
(image, output folder or file).)";

constexpr const char* kStudyFooter =
    R"(How well the motion from the fisheye to the left camera is found from one pair of images: every
fifth frame of sequences with a fisheye and true poses. METHODS, with commas between:
  sift, rootsift           ours
  cv_sift, cv_rootsift, orb, akaze, kaze, brisk, surf (where OpenCV has it)   OpenCV's
  onnx:FILE.yaml           a learned network; docs/feature_study.md says what FILE holds
Writes to DIR: study.csv (sequence,method,auc_rotation,auc_translation,mean_inliers,ms_per_image,
ms_per_match), study_bearings.csv (the same on bearings), pairs.csv, study.txt, study.tex, study.html.

Exit codes: 0 done; 1 internal error; 2 bad usage, or no method that can be used here; 3 bad input
(dataset, network, output folder).)";

constexpr int kMaxFeatures = 1000000;

void add_options(CLI::App& app, CommandLine& line) {
  static const std::map<std::string, FeatureEngine> kEngines{{"cpu", FeatureEngine::kCpu},
                                                             {"cuda", FeatureEngine::kCuda},
                                                             {"opencv", FeatureEngine::kOpenCv}};
  static const std::map<std::string, bool> kSwitch{{"on", true}, {"off", false}};
  app.add_option("IMAGE", line.images, "PNG or JPEG files; match: two or more")->required();
  app.add_option("--engine", line.engine,
                 "cpu (default), cuda, or opencv: OpenCV's SIFT, for comparison")
      ->transform(CLI::CheckedTransformer(kEngines).description(""))
      ->option_text("NAME");
  app.add_option("--upsample", line.sift.upsample,
                 "on (default: start with an octave at twice the resolution) or off")
      ->transform(CLI::CheckedTransformer(kSwitch).description(""))
      ->option_text("on|off");
  app.add_option("--features", line.sift.max_features, "per image, at most")
      ->capture_default_str()
      ->check(CLI::Range(1, kMaxFeatures).description(""));
  app.add_option("--threads", line.threads, "images at a time")
      ->capture_default_str()
      ->check(CLI::Range(1, 256).description(""));
  app.add_option("--repeat", line.repeat, "runs per image, of which the median time is told")
      ->capture_default_str()
      ->check(CLI::Range(1, 100000).description(""));
  app.add_option("--out", line.out, "folder for the results, made if missing")
      ->capture_default_str();
  app.add_option("--json", line.json, "file for the times and counts");
}

void add_study_options(CLI::App& app, StudyOptions& study, std::string& methods) {
  app.add_option("DATASET", study.datasets, "folders of hybrid sequences with truth")->required();
  app.add_option("--methods", methods, "names with commas between")
      ->capture_default_str()
      ->option_text("METHODS");
  app.add_option("--features", study.sift.max_features, "per image, at most")
      ->capture_default_str()
      ->check(CLI::Range(1, kMaxFeatures).description(""));
  app.add_option("--every", study.every, "only every so many frames")
      ->capture_default_str()
      ->check(CLI::Range(1, kMaxFeatures).description(""));
  app.add_option("--threshold", study.threshold,
                 "of an inlier [px], at the mean of the two focal lengths")
      ->capture_default_str()
      ->check(CLI::Range(1e-3, 1e3).description(""))
      ->option_text("PX");
  app.add_flag("--masks", study.masks,
               "no features on tags (tags.txt) and where the dataset's masks are black");
  app.add_option("--out", study.out, "folder for the results, made if missing")
      ->capture_default_str();
  app.footer(kStudyFooter);
}

void check_study(const StudyOptions& study) {
  if (study.out.empty()) throw CLI::ValidationError("--out: \"\" is no name of a folder");
  std::string missing;
  bool usable = false;
  for (std::size_t i = 0; i < study.methods.size(); ++i) {
    const std::string& name = study.methods[i];
    if (const std::string why = why_no_method_name(name); !why.empty()) {
      throw CLI::ValidationError("--methods: " + why);
    }
    const auto before = study.methods.begin() + static_cast<std::ptrdiff_t>(i);
    if (std::find(study.methods.begin(), before, name) != before) {
      throw CLI::ValidationError("--methods: " + name + " stands there twice");
    }
    missing = why_no_opencv_features(name);
    usable = usable || missing.empty();
  }
  if (!usable) throw CLI::ValidationError("--methods " + study.methods.back() + ": " + missing);
}

void check(const CommandLine& line) {
  if (line.command == EvalCommand::kMatch && line.images.size() < 2) {
    throw CLI::ValidationError("match: needs two images or more");
  }
  if (line.out.empty()) throw CLI::ValidationError("--out: \"\" is no name of a folder");
  const std::string why_not = why_no_engine(line.engine, line.sift);
  if (!why_not.empty()) {
    throw CLI::ValidationError("--engine " + to_string(line.engine) + ": " + why_not);
  }
}

}  // namespace

std::optional<CommandLine> parse_command_line(int argc, char** argv, int& exit_code) {
  CommandLine line;
  CLI::App app(
      "Shows the features that the front end sees in images, how they match, and how they compare "
      "with others.",
      "feature_eval");
  app.footer(kFooter);
  app.require_subcommand(1);
  auto* const extract = app.add_subcommand("extract", "find features in each image");
  auto* const match = app.add_subcommand("match", "match the first image with each other one");
  for (CLI::App* const command : {extract, match}) {
    add_options(*command, line);
    command->footer(kFooter);
  }
  std::string methods = "sift,rootsift,cv_sift,cv_rootsift,orb,akaze,kaze,brisk";
  auto* const study =
      app.add_subcommand("study", "compare features by the motion between two cameras");
  add_study_options(*study, line.study, methods);
  if (const auto end = parse_line(app, argc, argv, [&] {
        if (study->parsed()) {
          line.command = EvalCommand::kStudy;
          line.study.methods = split_method_names(methods);
          check_study(line.study);
          return;
        }
        line.command = match->parsed() ? EvalCommand::kMatch : EvalCommand::kExtract;
        check(line);
      })) {
    exit_code = *end;
    return std::nullopt;
  }
  return line;
}

}  // namespace hybrid_slam
