#include "frontend/input/image_file.h"

#include <png.h>
#include <zlib.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "test/frontend/input/dataset_writer.h"
#include "test/support/allocation_watch.h"

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

// Any kind of PNG, with random samples. Palettes have 2^bits random entries, the first half of them
// transparent.
void write_png(const std::filesystem::path& path, int color_type, int bits, bool interlaced) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "wb"),
                                                             std::fclose);
  REQUIRE(file);
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file.get());
  png_set_IHDR(png, info, kSize.width, kSize.height, bits, color_type,
               interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  cv::RNG rng(static_cast<std::uint64_t>(color_type * 100 + bits));
  const auto byte = [&] { return static_cast<png_byte>(rng.uniform(0, 256)); };
  if (color_type == PNG_COLOR_TYPE_PALETTE) {
    std::vector<png_color> palette(std::size_t{1} << bits);
    for (png_color& entry : palette) entry = {byte(), byte(), byte()};
    png_set_PLTE(png, info, palette.data(), static_cast<int>(palette.size()));
    const std::vector<png_byte> alpha(palette.size() / 2, 0);
    png_set_tRNS(png, info, alpha.data(), static_cast<int>(alpha.size()), nullptr);
  }
  png_write_info(png, info);
  const std::size_t bytes = png_get_rowbytes(png, info);
  std::vector<std::vector<png_byte>> rows(kSize.height, std::vector<png_byte>(bytes));
  std::vector<png_bytep> pointers;
  for (auto& row : rows) {
    for (png_byte& value : row) value = byte();
    pointers.push_back(row.data());
  }
  png_write_image(png, pointers.data());
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
}

void check_same_as_opencv(const std::filesystem::path& path) {
  const cv::Mat expected =
      cv::imread(path.string(), cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
  REQUIRE(expected.cols == kSize.width);
  CHECK(holds(read_gray_image(path, kSize), expected));
  CHECK(holds(read_gray_image(path), expected));
}

TEST_CASE("every kind of PNG gives the pixels that OpenCV makes of it") {
  const TempFolder folder;
  const std::vector<std::pair<int, std::vector<int>>> kinds{{PNG_COLOR_TYPE_GRAY, {1, 2, 4, 8, 16}},
                                                            {PNG_COLOR_TYPE_PALETTE, {1, 2, 4, 8}},
                                                            {PNG_COLOR_TYPE_RGB, {8, 16}},
                                                            {PNG_COLOR_TYPE_RGB_ALPHA, {8, 16}},
                                                            {PNG_COLOR_TYPE_GRAY_ALPHA, {8, 16}}};
  for (const auto& [color_type, depths] : kinds) {
    for (const int bits : depths) {
      for (const bool interlaced : {false, true}) {
        INFO("colour type " << color_type << ", " << bits << " bits, interlaced " << interlaced);
        write_png(folder.path() / "a.png", color_type, bits, interlaced);
        check_same_as_opencv(folder.path() / "a.png");
      }
    }
  }
}

TEST_CASE("every kind of JPEG gives the pixels that OpenCV makes of it") {
  const TempFolder folder;
  const auto path = folder.path() / "a.jpg";
  cv::Mat noise(kSize.height, kSize.width, CV_8UC3);
  cv::RNG(7).fill(noise, cv::RNG::UNIFORM, 0, 256);
  for (const int progressive : {0, 1}) {
    for (const int restart : {0, 2}) {
      for (const int quality : {30, 95}) {
        const std::vector<int> options{cv::IMWRITE_JPEG_PROGRESSIVE,  progressive,
                                       cv::IMWRITE_JPEG_RST_INTERVAL, restart,
                                       cv::IMWRITE_JPEG_QUALITY,      quality};
        INFO("progressive " << progressive << ", restarts " << restart << ", quality " << quality);
        REQUIRE(cv::imwrite(path.string(), noise, options));
        check_same_as_opencv(path);
        REQUIRE(cv::imwrite(path.string(), smooth_picture(), options));
        check_same_as_opencv(path);
      }
    }
  }
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

TEST_CASE("10 and 12 bits in 16 become the 8 that they are meant to be") {
  const TempFolder folder;
  const cv::Mat picture = test_picture(kSize.width, kSize.height, 2);  // up to 250
  for (const int bits : {10, 12, 14}) {
    cv::Mat wide;
    picture.convertTo(wide, CV_16UC1, 1 << (bits - 8));
    for (const char* const name : {"wide.png", "wide.tif", "wide.pgm"}) {
      CAPTURE(bits, name);
      write_picture(folder.path() / name, wide);
      const int white = (1 << bits) - 1;
      CHECK(white_above(highest_wide_sample(folder.path() / name)) == white);
      CHECK(holds(read_gray_image(folder.path() / name, kSize), picture));
      CHECK(holds(read_gray_image(folder.path() / name, {GrayChannel::kGrey, white}), picture));
      const GrayImage dark = read_gray_image(folder.path() / name, {GrayChannel::kGrey, 65535});
      CHECK(dark.pixels[77] == picture.at<std::uint8_t>(77) >> (16 - bits));
    }
  }
  write_picture(folder.path() / "plain.png", picture);
  CHECK(highest_wide_sample(folder.path() / "plain.png") == 0);
}

TEST_CASE("TIFF, PGM, PPM and BMP give the pixels that were written") {
  const TempFolder folder;
  const cv::Mat picture = test_picture(kSize.width, kSize.height, 3);
  cv::Mat colour(kSize.height, kSize.width, CV_8UC3);
  cv::RNG(5).fill(colour, cv::RNG::UNIFORM, 0, 256);
  for (const char* const name : {"a.tif", "a.tiff", "a.pgm", "a.bmp"}) {
    CAPTURE(name);
    write_picture(folder.path() / name, picture);
    CHECK(has_image_extension(folder.path() / name));
    CHECK(holds(read_gray_image(folder.path() / name, kSize), picture));
  }
  REQUIRE(cv::imwrite((folder.path() / "text.pgm").string(), picture, {cv::IMWRITE_PXM_BINARY, 0}));
  CHECK(holds(read_gray_image(folder.path() / "text.pgm", kSize), picture));
  cv::Mat channels[3];
  cv::split(colour, channels);  // blue, green, red
  for (const char* const name : {"a.tif", "a.ppm", "a.bmp", "a.png"}) {
    CAPTURE(name);
    write_picture(folder.path() / name, colour);
    const GrayImage grey = read_gray_image(folder.path() / name, kSize);
    for (std::size_t i = 0; i < grey.pixels.size(); ++i) {
      const cv::Vec3b& bgr = colour.at<cv::Vec3b>(static_cast<int>(i));
      const double weighed = 0.114 * bgr[0] + 0.587 * bgr[1] + 0.299 * bgr[2];
      if (!(std::abs(grey.pixels[i] - weighed) <= 1.01)) FAIL(i << ": " << weighed);
    }
    CHECK(holds(read_gray_image(folder.path() / name, {GrayChannel::kBlue, 0}), channels[0]));
    CHECK(holds(read_gray_image(folder.path() / name, {GrayChannel::kGreen, 0}), channels[1]));
    CHECK(holds(read_gray_image(folder.path() / name, {GrayChannel::kRed, 0}), channels[2]));
  }
  write_picture(folder.path() / "a.jpg", colour);
  const cv::Mat decoded = cv::imread((folder.path() / "a.jpg").string(), cv::IMREAD_COLOR);
  cv::split(decoded, channels);
  CHECK(holds(read_gray_image(folder.path() / "a.jpg", {GrayChannel::kGreen, 0}), channels[1]));
  cv::Mat wide;
  colour.convertTo(wide, CV_16UC3, 16);
  write_picture(folder.path() / "wide.png", wide);
  cv::split(colour, channels);
  CHECK(holds(read_gray_image(folder.path() / "wide.png", {GrayChannel::kRed, 4095}), channels[2]));
}

TEST_CASE("TIFF, PGM and BMP that are cut anywhere are refused") {
  const TempFolder folder;
  const cv::Mat picture = test_picture(kSize.width, kSize.height, 3);
  for (const char* const name : {"a.tif", "a.pgm", "a.bmp"}) {
    write_picture(folder.path() / name, picture);
    const std::string whole = read_text(folder.path() / name);
    const auto part = folder.path() / (std::string("part_") + name);
    for (std::size_t length = 0; length < whole.size(); length += 1 + whole.size() / 60) {
      CAPTURE(name, length, whole.size());
      write_text(part, whole.substr(0, length));
      GrayImage image;
      const std::string line = complaint([&] { image = read_gray_image(part, kSize); });
      CHECK((!line.empty() || holds(image, picture)));
    }
  }
}

// A number as it lies in a file of little endian.
template <typename T>
std::string bytes_of(T value) {
  return {reinterpret_cast<const char*>(&value), sizeof(value)};
}

TEST_CASE("what libtiff says of a damaged file in two lines is one") {
  const TempFolder folder;
  // Tag, type (2: text, 3: 16 bits, 4: 32 bits), count, value: RGB, but one name of an ink.
  const std::array<std::uint32_t, 4> tags[] = {
      {256, 3, 1, 8},    {257, 3, 1, 6}, {258, 3, 1, 8}, {259, 3, 1, 1},   {262, 3, 1, 2},
      {273, 4, 1, 9000}, {277, 3, 1, 3}, {278, 3, 1, 6}, {279, 4, 1, 144}, {333, 2, 2, 'A'}};
  std::string file = "II*" + std::string(1, '\0') + bytes_of<std::uint32_t>(8) +
                     bytes_of(static_cast<std::uint16_t>(std::size(tags)));
  for (const auto& [tag, type, count, value] : tags) {
    file += bytes_of(static_cast<std::uint16_t>(tag)) + bytes_of(static_cast<std::uint16_t>(type)) +
            bytes_of(count) + bytes_of(value);
  }
  write_text(folder.path() / "a.tif", file + bytes_of<std::uint32_t>(0));
  const std::string line = complaint([&] {
    read_gray_image(folder.path() / "a.tif", ImageSize{8, 6});
  });
  CHECK(line.find("NumberOfInks") != std::string::npos);
  CHECK(line.find('\n') == std::string::npos);
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

TEST_CASE("a PNG is refused for damage beside its pixels, too") {
  const TempFolder folder;
  const std::filesystem::path path = folder.path() / "a.png";
  write_png(path, PNG_COLOR_TYPE_PALETTE, 8, false);
  std::string bytes = read_text(path);
  const std::size_t transparency = bytes.find("tRNS");
  REQUIRE(transparency != std::string::npos);
  bytes[transparency + 4] = 'x';
  write_text(path, bytes);
  CHECK(complaint([&] { read_gray_image(path); }) ==
        path.string() + ": damaged PNG (tRNS: CRC error)");
}

TEST_CASE("a JPEG that lacks some of its compressed data is refused") {
  const TempFolder folder;
  cv::Mat noise(kSize.height, kSize.width, CV_8UC1);
  cv::RNG(7).fill(noise, cv::RNG::UNIFORM, 0, 256);
  write_picture(folder.path() / "a.jpg", noise);
  std::string bytes = read_text(folder.path() / "a.jpg");
  bytes.erase(bytes.size() / 2, bytes.size() / 4);  // its end marker stays
  write_text(folder.path() / "a.jpg", bytes);
  const std::string line = complaint([&] { read_gray_image(folder.path() / "a.jpg", kSize); });
  CHECK(line.find("a.jpg: damaged JPEG (") != std::string::npos);
}

// The header alone made room for a gigabyte.
TEST_CASE(
    "a file of few bytes that tells of many pixels is refused before there is room for them") {
  const TempFolder folder;
  const auto path = folder.path() / "a";
  const auto refusal = [&](const std::string& file) {
    write_text(path, file);
    return complaint([&] { read_gray_image(path); });
  };
  const auto number = [](std::uint32_t value, bool big_endian) {
    std::string bytes;
    for (int i = 0; i < 4; ++i) {
      bytes += static_cast<char>(value >> (big_endian ? 24 - 8 * i : 8 * i));
    }
    return bytes;
  };
  const auto chunk = [&](const std::string& content) {  // of a PNG
    const auto* const bytes = reinterpret_cast<const Bytef*>(content.data());
    return number(static_cast<std::uint32_t>(content.size()) - 4, true) + content +
           number(static_cast<std::uint32_t>(crc32(0, bytes, static_cast<uInt>(content.size()))),
                  true);
  };
  const std::string begin = "\x89PNG\r\n\x1a\n";
  const auto png = [&](std::uint32_t side, const std::string& kind) {
    return begin + chunk("IHDR" + number(side, true) + number(side, true) + kind) + chunk("IDAT");
  };
  using namespace std::string_literals;
  const AllocationWatch watch;
  CHECK(refusal(png(30000, "\x08\0\0\0\0"s)).find("more pixels than its bytes can hold") !=
        std::string::npos);
  CHECK(refusal(png(850, "\x10\x06\0\0\0"s)).ends_with("truncated PNG"));  // 8 bytes each
  CHECK(refusal("P5 30000 30000 255\n").ends_with("truncated PGM or PPM"));
  const std::string bmp = "BM" + number(54, false) + number(0, false) + number(54, false) +
                          number(40, false) + number(30000, false) + number(30000, false) +
                          "\x01\0\x18\0"s + std::string(24, '\0');
  CHECK(refusal(bmp).ends_with("truncated BMP"));
  CHECK(watch.largest() < (1 << 20));
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
