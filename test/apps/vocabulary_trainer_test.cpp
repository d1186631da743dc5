// vocabulary_trainer as its user sees it.
#include <fstream>

#include <catch2/catch.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "frontend/features/sift.h"
#include "frontend/input/image_file.h"
#include "frontend/place_recognition/image_words.h"
#include "frontend/place_recognition/vocabulary_file.h"
#include "test/support/child_process.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

// Blobs of all sizes, different ones per seed.
cv::Mat blobs(int seed) {
  cv::Mat sum(200, 260, CV_32F, cv::Scalar(128));
  cv::RNG random(static_cast<std::uint64_t>(seed));
  for (int size = 4; size <= 32; size *= 2) {
    cv::Mat coarse(sum.rows / size + 2, sum.cols / size + 2, CV_32F), fine;
    random.fill(coarse, cv::RNG::NORMAL, 0, 14);
    cv::resize(coarse, fine, sum.size(), 0, 0, cv::INTER_CUBIC);
    sum += fine;
  }
  sum.convertTo(sum, CV_8U);
  return sum;
}

void write_images(const std::filesystem::path& folder, int count) {
  std::filesystem::create_directory(folder);
  for (int i = 0; i < count; ++i) {
    cv::imwrite((folder / (std::to_string(100 + i) + ".png")).string(), blobs(i + 1));
  }
  std::ofstream(folder / "notes.txt") << "no image\n";
}

Outcome run_trainer(const std::filesystem::path& folder, std::vector<std::string> arguments) {
  return run_program(VOCABULARY_TRAINER, arguments, folder);
}

std::string content_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST_CASE("vocabulary_trainer makes the same vocabulary with any number of threads") {
  const TempFolder folder;
  write_images(folder.path() / "images", 9);
  const std::vector<std::string> small{"images",     "--branching", "5",       "--levels", "3",
                                       "--features", "300",         "--quiet", "--output"};
  const auto train = [&](const std::string& output, const std::vector<std::string>& more) {
    std::vector<std::string> arguments = small;
    arguments.push_back(output);
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run_trainer(folder.path(), arguments);
    CHECK(outcome.code == 0);
    CHECK(outcome.err.empty());
    CHECK(outcome.out.find("of 9 images") != std::string::npos);
  };
  train("one.voc", {"--threads", "1"});
  train("three.voc", {"--threads", "3"});
  CHECK(content_of(folder.path() / "one.voc") == content_of(folder.path() / "three.voc"));
  train("small.voc", {"--compress"});
  train("voc.txt", {});

  // What was written in whatever format is one vocabulary.
  const Vocabulary vocabulary =
      load_vocabulary(folder.path() / "one.voc", DescriptorKind::kRootSift);
  CHECK(vocabulary.words() > 100);
  CHECK(vocabulary.words() <= 125);
  const auto sift = make_sift({});
  std::vector<BowVector> images;
  for (int i = 0; i < 9; ++i) {
    const auto path = folder.path() / "images" / (std::to_string(100 + i) + ".png");
    const FeatureSet features = sift->extract(read_gray_image(path, {260, 200}), nullptr);
    images.push_back(find_words(vocabulary, features).bow);
    for (const char* other : {"small.voc", "voc.txt"}) {
      CHECK(find_words(load_vocabulary(folder.path() / other), features).bow == images.back());
    }
  }
  for (std::size_t i = 1; i < images.size(); ++i) {
    CHECK(images[0] != images[i]);
  }
  // No temporary file is left behind.
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    CHECK_FALSE(entry.path().filename().string().starts_with("descriptors"));
  }
}

TEST_CASE("vocabulary_trainer converts vocabularies") {
  const TempFolder folder;
  write_images(folder.path() / "images", 2);
  REQUIRE(run_trainer(folder.path(), {"images", "--output", "a.txt", "--levels", "2"}).code == 0);
  REQUIRE(run_trainer(folder.path(), {"--convert", "a.txt", "--output", "a.voc"}).code == 0);
  REQUIRE(run_trainer(folder.path(), {"--convert", "a.voc", "--output", "b.txt"}).code == 0);
  CHECK(content_of(folder.path() / "a.txt") == content_of(folder.path() / "b.txt"));
}

TEST_CASE("vocabulary_trainer refuses bad input in one line") {
  const TempFolder folder;
  write_images(folder.path() / "images", 2);
  const auto refused = [&](const std::vector<std::string>& arguments, int code,
                           const std::string& reason) {
    const Outcome outcome = run_trainer(folder.path(), arguments);
    INFO(outcome.err << "expected: " << reason);
    CHECK(outcome.code == code);
    CHECK(outcome.err.starts_with("vocabulary_trainer: "));
    CHECK(outcome.err.find(reason) != std::string::npos);
    CHECK(outcome.err.find('\n') + 1 == outcome.err.size());
    CHECK(outcome.out.empty());
  };
  refused({"--output", "a"}, 2, "either IMAGES or --convert is needed");
  refused({"images"}, 2, "--output is required");
  refused({"images", "--output", "a", "--branching", "1"}, 2, "--branching");
  refused({"images", "--output", "a", "--levels", "11"}, 2, "--levels");
  refused({"none", "--output", "a"}, 3, "none: no such file or folder");
  std::filesystem::create_directory(folder.path() / "empty");
  refused({"empty", "--output", "a"}, 3, "empty: no images in this folder");
  refused({"images/notes.txt", "--quiet", "--output", "a"}, 3, "images/notes.txt");
  refused({"images", "--quiet", "--output", "none/a"}, 3, "none");
  cv::imwrite((folder.path() / "grey.png").string(), cv::Mat(100, 100, CV_8U, cv::Scalar(9)));
  refused({"grey.png", "--quiet", "--output", "a"}, 3, "the images have no features");
  std::ofstream(folder.path() / "voc.txt") << "10 6 0 0\n0 1 1 2 3\n";
  refused({"--convert", "voc.txt", "--output", "a"}, 3, "voc.txt:2: too short for a node");
  CHECK_FALSE(std::filesystem::exists(folder.path() / "a"));
}

}  // namespace
}  // namespace hybrid_slam
