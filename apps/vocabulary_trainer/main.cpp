#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <functional>
#include <optional>

#include "apps/io/progress_line.h"
#include "apps/program/program.h"
#include "apps/slam/parallel_for.h"
#include "apps/vocabulary_trainer/training_run.h"
#include "frontend/place_recognition/vocabulary_file.h"

namespace hybrid_slam {
namespace {

constexpr const char* kDescription =
    "Trains a vocabulary for place recognition on the SIFT features of images, or converts one.";

constexpr const char* kFooter =
    R"(OUTPUT ending in .txt is written as DBoW2's text, else in the binary format that
is mapped into memory (docs/vocabulary.md). The same images and options give the
same file, whatever the number of threads.

Exit codes: 0 done; 1 internal error; 2 bad usage; 3 bad input or output.)";

struct Options {
  std::vector<std::string> images;
  std::string convert;
  std::string output;
  bool compress = false;
  bool quiet = false;
  TrainingRunOptions run;
};

// A line for each unit that is counted.
class Progress {
 public:
  explicit Progress(bool quiet) : quiet_(quiet) {}

  void operator()(const std::string& unit, std::size_t done, std::size_t total) {
    if (unit != unit_) {
      finish();
      unit_ = unit;
      line_.emplace(unit, quiet_);
    }
    line_->update(done, total, {});
  }

  void finish() {
    if (line_) line_->finish();
  }

 private:
  bool quiet_;
  std::string unit_;
  std::optional<ProgressLine> line_;
};

void save(const Options& options, const Vocabulary& vocabulary) {
  const bool text = std::filesystem::path(options.output).extension() == ".txt";
  save_vocabulary(options.output, vocabulary,
                  text               ? VocabularyFormat::kText
                  : options.compress ? VocabularyFormat::kCompressed
                                     : VocabularyFormat::kMapped);
  fmt::print("{}: {} words, {} levels, {} descriptors\n", options.output, vocabulary.words(),
             vocabulary.depth(), kind_name(vocabulary.kind()));
}

void train(Options& options) {
  const auto images = find_images(options.images);
  std::filesystem::path& scratch = options.run.scratch;
  if (scratch.empty()) scratch = std::filesystem::path(options.output).parent_path();
  if (scratch.empty()) scratch = ".";
  if (options.run.threads == 0) options.run.threads = default_thread_count();
  Progress progress(options.quiet);
  const TrainingRun run = train_on_images(images, options.run, std::ref(progress));
  progress.finish();
  fmt::print("{} descriptors of {} images\n", run.descriptors, images.size());
  save(options, run.vocabulary);
}

void add_options(CLI::App& app, Options& options) {
  VocabularyTrainingOptions& training = options.run.training;
  app.add_option("IMAGES", options.images, "image files, and folders of them (.png, .jpg)");
  app.add_option("--output", options.output, "the vocabulary to write")->required();
  app.add_option("--convert", options.convert, "write this vocabulary in the format of the output");
  app.add_option("--branching", training.branching, "children of a node")
      ->check(CLI::Range(2, kMaxBranching))
      ->capture_default_str();
  app.add_option("--levels", training.levels, "below the root: branching ^ levels words at most")
      ->check(CLI::Range(1, kMaxLevels))
      ->capture_default_str();
  app.add_option("--features", options.run.sift.max_features, "per image, at most")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--contrast", options.run.sift.contrast_threshold,
                 "of features, |difference of Gaussians|, grey levels 0..255")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--seed", training.seed, "of the clustering")->capture_default_str();
  app.add_option("--threads", options.run.threads, "(default: one per core)")
      ->check(CLI::PositiveNumber);
  app.add_option("--scratch", options.run.scratch,
                 "folder of temporary files, 256 bytes per descriptor (default: the output's)");
  app.add_flag("--compress", options.compress, "a small binary file, which is not mapped");
  app.add_flag("--quiet", options.quiet, "no progress");
}

int run(int argc, char** argv) {
  Options options;
  options.run.threads = 0;
  CLI::App app(kDescription);
  app.footer(kFooter);
  add_options(app, options);
  if (const auto end = parse_line(app, argc, argv, [&] {
        if (options.images.empty() == options.convert.empty()) {
          throw CLI::ValidationError("either IMAGES or --convert is needed");
        }
      })) {
    return *end;
  }
  if (options.convert.empty()) {
    train(options);
  } else {
    save(options, load_vocabulary(options.convert));
  }
  return kExitOk;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  using namespace hybrid_slam;
  return run_program("vocabulary_trainer", [&] { return run(argc, argv); });
}
