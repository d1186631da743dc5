#include "frontend/input/image_file.h"

#include <catch2/catch.hpp>
#include <opencv2/imgproc.hpp>

#include "test/frontend/input/dataset_writer.h"

namespace hybrid_slam {
namespace {

constexpr ImageSize kSize{64, 48};

cv::Mat smooth_picture() {
  cv::Mat picture(kSize.height, kSize.width, CV_8UC1);
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      picture.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(2 * x + 2 * y);
    }
  }
  return picture;
}

TEST_CASE("a grey PNG is read pixel by pixel") {
  const TempFolder folder;
  const cv::Mat picture = test_picture(kSize.width, kSize.height, 1);
  write_picture(folder.path() / "a.png", picture);
  CHECK(read_image_size(folder.path() / "a.png") == kSize);
  CHECK(holds(read_gray_image(folder.path() / "a.png", kSize), picture));
}

TEST_CASE("a JPEG is read, whatever its ending says") {
  const TempFolder folder;
  const cv::Mat picture = smooth_picture();
  write_picture(folder.path() / "a.jpg", picture);
  std::filesystem::rename(folder.path() / "a.jpg", folder.path() / "a.png");
  const GrayImage image = read_gray_image(folder.path() / "a.png", kSize);
  REQUIRE(image.width == kSize.width);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      CHECK(std::abs(image.row(y)[x] - picture.at<std::uint8_t>(y, x)) <= 4);
    }
  }
}

TEST_CASE("colour becomes grey and 16 bits become 8") {
  const TempFolder folder;
  const cv::Mat colour(kSize.height, kSize.width, CV_8UC3, cv::Scalar(200, 100, 50));
  write_picture(folder.path() / "colour.png", colour);
  const GrayImage grey = read_gray_image(folder.path() / "colour.png", kSize);
  CHECK(std::abs(grey.pixels.front() - (0.114 * 200 + 0.587 * 100 + 0.299 * 50)) <= 1.5);

  const cv::Mat picture = test_picture(kSize.width, kSize.height, 2);
  cv::Mat wide;
  picture.convertTo(wide, CV_16UC1, 257);
  write_picture(folder.path() / "wide.png", wide);
  CHECK(holds(read_gray_image(folder.path() / "wide.png", kSize), picture));
}

TEST_CASE("a file truncated at any length is refused") {
  const TempFolder folder;
  cv::Mat noise(kSize.height, kSize.width, CV_8UC1);
  cv::RNG rng(7);
  rng.fill(noise, cv::RNG::UNIFORM, 0, 256);
  for (const char* const name : {"a.png", "a.jpg"}) {
    const std::filesystem::path whole = folder.path() / name;
    const std::filesystem::path part = folder.path() / "part";
    write_picture(whole, noise);
    const std::string bytes = read_text(whole);
    for (std::size_t length = 0; length < bytes.size(); length += length < 700 ? 1 : 37) {
      write_text(part, bytes.substr(0, length));
      const std::string line = complaint([&] { read_gray_image(part, kSize); });
      INFO(name << " of " << bytes.size() << " bytes, truncated to " << length);
      CHECK(line.find(part.string()) == 0);
    }
    write_text(part, bytes.substr(0, bytes.size() / 2) + std::string(bytes.size() / 2, '\0'));
    CHECK(!complaint([&] { read_gray_image(part, kSize); }).empty());
  }
}

TEST_CASE("a PNG altered anywhere before its end is refused or gives the same pixels") {
  const TempFolder folder;
  const cv::Mat picture = test_picture(kSize.width, kSize.height, 3);
  write_picture(folder.path() / "a.png", picture);
  const std::string bytes = read_text(folder.path() / "a.png");
  for (std::size_t at = 0; at < bytes.size(); at += 5) {
    std::string altered = bytes;
    altered[at] = static_cast<char>(altered[at] ^ 0x5a);
    write_text(folder.path() / "b.png", altered);
    GrayImage image;
    const std::string line =
        complaint([&] { image = read_gray_image(folder.path() / "b.png", kSize); });
    CHECK((!line.empty() || holds(image, picture)));
  }
}

TEST_CASE("what is no image, missing or of another size is refused") {
  const TempFolder folder;
  const auto line = [&](const char* name) {
    return complaint([&] { read_gray_image(folder.path() / name, kSize); });
  };
  CHECK(line("missing.png").find("no such image") != std::string::npos);
  write_text(folder.path() / "empty.png", "");
  CHECK(line("empty.png").find("empty") != std::string::npos);
  write_text(folder.path() / "text.png", "this is not an image at all, but long enough to be one");
  CHECK(line("text.png").find("neither PNG nor JPEG") != std::string::npos);
  write_picture(folder.path() / "small.png", test_picture(32, 48, 1));
  CHECK(line("small.png").find("32x48, expected 64x48") != std::string::npos);
  std::filesystem::create_directory(folder.path() / "folder.png");
  CHECK(!line("folder.png").empty());
}

TEST_CASE("a PNG that has all its chunks but not all its rows is refused") {
  const TempFolder folder;
  // Signature, IHDR of a 64x48 grey image and IEND: no image data between them.
  write_picture(folder.path() / "a.png", test_picture(kSize.width, kSize.height, 1));
  const std::string bytes = read_text(folder.path() / "a.png");
  write_text(folder.path() / "b.png", bytes.substr(0, 33) + bytes.substr(bytes.size() - 12));
  CHECK(!complaint([&] { read_gray_image(folder.path() / "b.png", kSize); }).empty());
}

}  // namespace
}  // namespace hybrid_slam
