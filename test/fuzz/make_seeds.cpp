#include <fstream>
#include <iostream>

#include <opencv2/imgcodecs.hpp>

#include "backend/map/map_file.h"
#include "frontend/place_recognition/vocabulary_file.h"
#include "test/frontend/input/bags/bag_writer.h"
#include "test/support/filled_map.h"

// Makes the first inputs of targets whose formats are binary: fuzz_seeds FOLDER puts them into
// FOLDER/TARGET. The others are in the folder seeds.
namespace hybrid_slam {

namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 8, kHeight = 6;

void write(const fs::path& path, std::string_view content) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << content;
}

std::string_view text_of(const ByteVector& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

cv::Mat picture(int type) {
  cv::Mat result(kHeight, kWidth, type);
  cv::RNG(7).fill(result, cv::RNG::UNIFORM, 0, 256);
  return result;
}

ByteVector encoded(const cv::Mat& image, const char* ending, const std::vector<int>& how = {}) {
  ByteVector bytes;
  if (!cv::imencode(ending, image, bytes, how)) throw std::runtime_error("cannot encode");
  return bytes;
}

void make_images(const fs::path& folder) {
  const std::pair<const char*, int> kinds[]{
      {"gray8", CV_8UC1}, {"gray16", CV_16UC1}, {"rgb8", CV_8UC3}, {"rgb16", CV_16UC3}};
  for (const auto& [name, type] : kinds) {
    const cv::Mat image = picture(type);
    write(folder / "png" / name, text_of(encoded(image, ".png")));
    constexpr int kPlain = 1, kLzw = 5, kDeflate = 8;
    for (const int compression : {kPlain, kLzw, kDeflate}) {
      write(folder / "tiff" / (name + std::to_string(compression)),
            text_of(encoded(image, ".tiff", {cv::IMWRITE_TIFF_COMPRESSION, compression})));
    }
    const bool is_color = image.channels() == 3;
    for (const int binary : {0, 1}) {
      write(folder / "bitmap" / (name + std::string(binary != 0 ? "_binary" : "_text")),
            text_of(encoded(image, is_color ? ".ppm" : ".pgm", {cv::IMWRITE_PXM_BINARY, binary})));
    }
    if (image.depth() != CV_8U) continue;
    write(folder / "bitmap" / (name + std::string("_bmp")), text_of(encoded(image, ".bmp")));
    for (const int progressive : {0, 1}) {
      write(folder / "jpeg" / (name + std::to_string(progressive)),
            text_of(encoded(image, ".jpg", {cv::IMWRITE_JPEG_PROGRESSIVE, progressive})));
    }
  }
}

CameraInfoMessage info_of(bool is_right, bool is_fisheye, bool is_raw) {
  CameraInfoMessage info;
  info.width = kWidth, info.height = kHeight;
  info.distortion_model = is_fisheye ? "equidistant" : "plumb_bob";
  info.d.assign(is_fisheye ? 4 : 5, is_raw ? 0.01 : 0.0);
  info.k = {8, 0, 3.5, 0, 8, 2.5, 0, 0, 1};
  info.r = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.p = {8, 0, 3.5, is_right ? -0.8 : 0, 0, 8, 2.5, 0, 0, 0, 1, 0};
  return info;
}

// Two moments of a pair and a fisheye.
std::vector<TestMessage> recording(const Wire& wire) {
  const std::string package =
      wire.serialization == Serialization::kRos1 ? "sensor_msgs/" : "sensor_msgs/msg/";
  std::vector<TestMessage> messages;
  for (const std::int64_t stamp : {1'000'000'000, 1'100'000'000}) {
    for (const char* const camera : {"/left", "/right", "/fisheye"}) {
      const bool is_fisheye = camera[1] == 'f';
      const auto info = info_of(camera[1] == 'r', is_fisheye, false);
      messages.push_back({std::string(camera) + "/camera_info", package + "CameraInfo",
                          camera_info_bytes(wire, stamp, info)});
      if (is_fisheye) {
        messages.push_back(
            {std::string(camera) + "/image/compressed", package + "CompressedImage",
             compressed_image_bytes(wire, stamp, encoded(picture(CV_8UC1), ".png"))});
      } else {
        TestImage image{stamp, kWidth, kHeight, "mono8", false, kWidth, {}};
        image.data.assign(kWidth * kHeight, 77);
        messages.push_back(
            {std::string(camera) + "/image", package + "Image", image_bytes(wire, image)});
      }
    }
  }
  return messages;
}

void make_bags(const fs::path& folder) {
  const auto ros1 = recording({Serialization::kRos1, false});
  const auto ros2 = recording({Serialization::kCdr, false});
  for (const char* const name : {"bag_ros1", "bag_mcap", "bag_sqlite"}) {
    fs::create_directories(folder / name);
  }
  for (const char* const compression : {"none", "bz2", "lz4"}) {
    write_ros1_bag(folder / "bag_ros1" / compression, ros1, {compression, 4, true});
  }
  write_ros1_bag(folder / "bag_ros1" / "open", ros1, {"none", 4, false});
  for (const char* const compression : {"none", "lz4", "zstd"}) {
    write_mcap(folder / "bag_mcap" / compression, ros2, {compression, 4, true});
  }
  write_mcap(folder / "bag_mcap" / "flat", ros2, {"none", 0, false});
  fs::remove(folder / "bag_sqlite" / "bag");  // its writer adds to what is there
  write_sqlite_bag(folder / "bag_sqlite" / "bag", ros2);
}

void make_messages(const fs::path& folder) {
  int number = 0;
  const auto add = [&](const Wire& wire, const ByteVector& message) {
    const char* const kind = wire.serialization == Serialization::kRos1 ? "1" : "2";
    write(folder / "bag_message" / std::to_string(number++), kind + std::string(text_of(message)));
  };
  const std::tuple<const char*, std::uint32_t, bool> encodings[]{
      {"mono8", 1, false},  {"16UC1", 2, true},        {"bgr8", 3, false},
      {"rgba16", 8, false}, {"bayer_rggb8", 1, false}, {"bayer_gbrg16", 2, true}};
  for (const Wire& wire : {Wire{Serialization::kRos1, false}, Wire{Serialization::kCdr, false},
                           Wire{Serialization::kCdr, true}}) {
    for (const auto& [encoding, bytes, big_endian] : encodings) {
      TestImage image{1'000'000'000, kWidth, kHeight, encoding, big_endian, bytes * kWidth, {}};
      image.data.assign(std::size_t{image.step} * kHeight, 99);
      add(wire, image_bytes(wire, image));
    }
    add(wire, compressed_image_bytes(wire, 1'000'000'000, encoded(picture(CV_8UC3), ".jpg")));
    for (const bool is_fisheye : {false, true}) {
      add(wire, camera_info_bytes(wire, 1'000'000'000, info_of(false, is_fisheye, is_fisheye)));
    }
  }
}

// Two nodes below the root, each with two words.
Vocabulary small_vocabulary() {
  struct Tables {
    std::vector<NodeId> first_child{1, 3, 5, 7, 7, 7, 7, 7};
    std::vector<float> weights{0, 0, 0, 0.5F, 1, 1.5F, 2};
    std::vector<Descriptor> bytes = std::vector<Descriptor>(7);
  };
  const auto tables = std::make_shared<Tables>();
  for (std::size_t i = 0; i < tables->bytes.size(); ++i) {
    tables->bytes[i].fill(static_cast<std::uint8_t>(30 * i));
  }
  return {
      {DescriptorKind::kRootSift, 2, 2, tables->first_child, tables->weights, tables->bytes, {}},
      tables};
}

void make_vocabularies(const fs::path& folder) {
  for (const auto& [name, format] : {std::pair("mapped", VocabularyFormat::kMapped),
                                     std::pair("compressed", VocabularyFormat::kCompressed)}) {
    fs::create_directories(folder / "vocabulary_binary");
    save_vocabulary(folder / "vocabulary_binary" / name, small_vocabulary(), format);
  }
  fs::create_directories(folder / "vocabulary_text");
  save_vocabulary(folder / "vocabulary_text" / "small", small_vocabulary(),
                  VocabularyFormat::kText);
}

void make_map(const fs::path& folder) {
  SyntheticSceneOptions options;
  options.times = 4;
  options.landmarks = 60;
  options.fisheye = true;
  FillOptions fill;
  fill.odometry = true;
  FilledMap filled = fill_map(make_synthetic_scene(options), fill);
  MapEdit edit;
  edit.erased_keyframes = {filled.keyframes.back()};
  filled.map.apply(edit);
  fs::create_directories(folder / "map_file");
  save_map(folder / "map_file" / "small", filled.map.view(), {"program", "options"});
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  using namespace hybrid_slam;
  if (argc != 2) {
    std::cerr << "usage: fuzz_seeds FOLDER\n";
    return 2;
  }
  make_images(argv[1]);
  make_bags(argv[1]);
  make_messages(argv[1]);
  make_vocabularies(argv[1]);
  make_map(argv[1]);
}
