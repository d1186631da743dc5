#include <catch2/catch.hpp>

#include "frontend/input/bags/raw_image.h"
#include "test/frontend/input/bags/bag_writer.h"
#include "test/frontend/input/dataset_writer.h"

namespace hybrid_slam {
namespace {

// 3x2 mono8 at 1.5 s, frame_id "l", step 4, data 1 2 3 0 4 5 6 0: byte by byte, from the standard.
const ByteVector kLittleCdr{0, 1, 0, 0,                         //
                            1, 0, 0, 0, 0,   0x65, 0xcd, 0x1d,  // 1 s, 500000000 ns
                            2, 0, 0, 0, 'l', 0,    0,    0,     // and two of padding
                            2, 0, 0, 0, 3,   0,    0,    0,     // height, width
                            6, 0, 0, 0, 'm', 'o',  'n',  'o',  '8', 0, 0, 0,
                            4, 0, 0, 0,  // little endian, padding, step
                            8, 0, 0, 0, 1,   2,    3,    0,    4,   5, 6, 0};
const ByteVector kBigCdr{0, 0, 0, 0,                                                   //
                         0, 0, 0, 1, 0x1d, 0xcd, 0x65, 0,                              //
                         0, 0, 0, 2, 'l',  0,    0,    0,                              //
                         0, 0, 0, 2, 0,    0,    0,    3,                              //
                         0, 0, 0, 6, 'm',  'o',  'n',  'o', '8', 0, 0, 0, 0, 0, 0, 4,  //
                         0, 0, 0, 8, 1,    2,    3,    0,   4,   5, 6, 0};
const ByteVector kRos1{
    9, 0, 0, 0, 1,   0,   0,   0,   0,   0x65, 0xcd, 0x1d,  // number, 1 s, 500000000 ns
    1, 0, 0, 0, 'l',                                        //
    2, 0, 0, 0, 3,   0,   0,   0,                           //
    5, 0, 0, 0, 'm', 'o', 'n', 'o', '8',                    //
    0, 4, 0, 0, 0,                                          //
    8, 0, 0, 0, 1,   2,   3,   0,   4,   5,    6,    0};

TEST_CASE("an image's fields are read from CDR of both byte orders and from ROS 1") {
  const auto [bytes, serialization] =
      GENERATE(table<ByteVector, Serialization>({{kLittleCdr, Serialization::kCdr},
                                                 {kBigCdr, Serialization::kCdr},
                                                 {kRos1, Serialization::kRos1}}));
  const MessageBytes message{bytes, serialization, "bag"};
  CHECK(read_stamp(message) == 1'500'000'000);
  const std::size_t start = kStampBytes + (serialization == Serialization::kCdr ? 4 : 0);
  CHECK(read_stamp({ByteView(bytes).first(start), serialization, "bag"}) == 1'500'000'000);
  const ImageMessage image = read_image_message(message);
  CHECK(image.width == 3);
  CHECK(image.height == 2);
  CHECK(image.encoding == "mono8");
  CHECK(image.step == 4);
  CHECK(ByteVector(image.data.begin(), image.data.end()) == ByteVector{1, 2, 3, 0, 4, 5, 6, 0});
  const DecodedImage gray = decode_raw_image(image, "image", std::nullopt, GrayChannel::kGrey);
  CHECK(gray.gray.pixels == ByteVector{1, 2, 3, 4, 5, 6});
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const ByteView part = ByteView(bytes).first(size);
    CHECK(complaint([&] { read_image_message({part, serialization, "bag"}); }) != "");
  }
}

TEST_CASE("CDR of another kind is refused by its number") {
  ByteVector bytes = kLittleCdr;
  bytes[1] = 3;
  CHECK(complaint([&] {
          read_stamp({bytes, Serialization::kCdr, "bag"});
        }) == "bag: a message is no plain CDR (it begins with 0x0003)");
}

TEST_CASE("CameraInfo comes back from every serialisation") {
  const Wire wire = GENERATE(Wire{Serialization::kRos1, false}, Wire{Serialization::kCdr, false},
                             Wire{Serialization::kCdr, true});
  CameraInfoMessage info;
  info.width = 640, info.height = 480;
  info.distortion_model = GENERATE("plumb_bob", "equidistant", "");
  info.d = {0.1, -0.2, 0.003, 0.004, 0.5};
  info.k = {500, 0, 320, 0, 501, 240, 0, 0, 1};
  info.r = {1, 0, 0, 0, 0, -1, 0, 1, 0};
  info.p = {510, 0, 321, -61.2, 0, 510, 241, 0, 0, 0, 1, 0};
  info.binning_x = 2, info.roi_width = 17, info.roi_height = 19;
  const ByteVector bytes = camera_info_bytes(wire, 5, info);
  const CameraInfoMessage read = read_camera_info({bytes, wire.serialization, "bag"});
  CHECK(read.width == 640);
  CHECK(read.height == 480);
  CHECK(read.distortion_model == info.distortion_model);
  CHECK(read.d == info.d);
  CHECK(read.k == info.k);
  CHECK(read.r == info.r);
  CHECK(read.p == info.p);
  CHECK(read.binning_x == 2);
  CHECK(read.roi_width == 17);
  CHECK(read.roi_height == 19);
}

struct EncodingCase {
  const char* encoding;
  std::uint32_t pixel;  // [bytes]
  ByteVector data;      // of 2x1
  ByteVector gray;      // by the usual weights
  ByteVector green;
};

// (9798 R + 19235 G + 3735 B) / 32768: of (10, 20, 30) 18.1, of (200, 100, 50) 124.2.
TEST_CASE("every encoding of 8 bits becomes the same grey") {
  const EncodingCase c = GENERATE(values<EncodingCase>({
      {"mono8", 1, {18, 124}, {18, 124}, {18, 124}},
      {"8UC1", 1, {18, 124}, {18, 124}, {18, 124}},
      {"rgb8", 3, {10, 20, 30, 200, 100, 50}, {18, 124}, {20, 100}},
      {"bgr8", 3, {30, 20, 10, 50, 100, 200}, {18, 124}, {20, 100}},
      {"8UC3", 3, {30, 20, 10, 50, 100, 200}, {18, 124}, {20, 100}},
      {"rgba8", 4, {10, 20, 30, 9, 200, 100, 50, 9}, {18, 124}, {20, 100}},
      {"bgra8", 4, {30, 20, 10, 9, 50, 100, 200, 9}, {18, 124}, {20, 100}},
  }));
  INFO(c.encoding);
  const ImageMessage image{2, 1, c.encoding, false, 2 * c.pixel, c.data};
  CHECK(decode_raw_image(image, "image", ImageSize{2, 1}, GrayChannel::kGrey).gray.pixels ==
        c.gray);
  CHECK(decode_raw_image(image, "image", ImageSize{2, 1}, GrayChannel::kGreen).gray.pixels ==
        c.green);
}

TEST_CASE("16 bits are read in the byte order that the message tells") {
  const bool big = GENERATE(false, true);
  const ByteVector data =
      big ? ByteVector{0x01, 0x02, 0x0f, 0xff} : ByteVector{0x02, 0x01, 0xff, 0x0f};
  const DecodedImage image =
      decode_raw_image({2, 1, "mono16", big, 4, data}, "image", std::nullopt, GrayChannel::kGrey);
  REQUIRE(image.is_wide());
  CHECK(image.samples == std::vector<std::uint16_t>{0x0102, 0x0fff});
  DecodedImage copy = image;
  CHECK(to_gray(std::move(copy), {GrayChannel::kGrey, 4095}).pixels == ByteVector{16, 255});
  const ByteVector colors = big ? ByteVector{1, 0, 2, 0, 3, 0} : ByteVector{0, 1, 0, 2, 0, 3};
  const DecodedImage color =
      decode_raw_image({1, 1, "bgr16", big, 6, colors}, "image", std::nullopt, GrayChannel::kGrey);
  CHECK(color.samples == std::vector<std::uint16_t>{0x300, 0x200, 0x100});
}

// Each cell of the pattern filters one colour: an even red scene lights its red cells alone.
TEST_CASE("Bayer patterns give back even colours") {
  const std::string pattern = GENERATE("rggb", "bggr", "gbrg", "grbg");
  constexpr std::uint32_t kSide = 6;
  const std::map<char, int> scene{{'r', 200}, {'g', 100}, {'b', 50}};
  for (const int bits : {8, 16}) {
    ByteVector data;
    for (std::uint32_t y = 0; y < kSide; ++y) {
      for (std::uint32_t x = 0; x < kSide; ++x) {
        const int value = scene.at(pattern[2 * (y % 2) + x % 2]);
        if (bits == 16) data.push_back(0);
        data.push_back(static_cast<std::uint8_t>(value));
      }
    }
    const std::string encoding = "bayer_" + pattern + std::to_string(bits);
    const std::uint32_t step = kSide * static_cast<std::uint32_t>(bits) / 8;
    for (const auto& [channel, expected] :
         {std::pair(GrayChannel::kRed, 200), std::pair(GrayChannel::kGreen, 100),
          std::pair(GrayChannel::kBlue, 50), std::pair(GrayChannel::kGrey, 124)}) {
      DecodedImage image = decode_raw_image({kSide, kSide, encoding, true, step, data}, "image",
                                            std::nullopt, channel);
      REQUIRE(image.is_wide() == (bits == 16));
      const GrayImage gray = to_gray(std::move(image), {channel, 255});
      INFO(encoding << " " << expected);
      CHECK(std::all_of(gray.pixels.begin(), gray.pixels.end(),
                        [&](std::uint8_t value) { return value == expected; }));
    }
  }
}

TEST_CASE("images that cannot be are refused in one line") {
  const ByteVector data(12);
  const auto refusal = [&](const ImageMessage& image, std::optional<ImageSize> size = {}) {
    return complaint([&] { decode_raw_image(image, "image", size, GrayChannel::kGrey); });
  };
  CHECK(refusal({2, 2, "yuv400", false, 4, data}) ==
        "image: image encoding \"yuv400\" is not known (mono, rgb, bgr, rgba, bgra and bayer of 8 "
        "and 16 bits are)");
  CHECK(refusal({4, 4, "mono8", false, 4, data}) ==
        "image: image is 4x4 mono8, but its data are too short");
  CHECK(refusal({4, 3, "mono8", false, 3, data}).ends_with("its data are too short"));
  CHECK(refusal({4, 3, "mono8", false, 4, data}, ImageSize{4, 4}) ==
        "image: image is 4x3, expected 4x4");
  CHECK(refusal({0, 3, "mono8", false, 4, data}) == "image: impossible image size in its header");
  CHECK(refusal({4, 3, "mono8", false, 4, data}) == "");
  CHECK(refusal({3, 3, "mono8", false, 4, ByteView(data).first(11)}) == "");  // unpadded last row
}

}  // namespace
}  // namespace hybrid_slam
