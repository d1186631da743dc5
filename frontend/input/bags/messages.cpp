#include "frontend/input/bags/messages.h"

#include <cstdio>

#include "cameras/files/printable.h"

namespace hybrid_slam {

namespace {

constexpr std::int64_t kNanoseconds = 1'000'000'000;  // in a second

// A message's fields, in order. ROS 1 has no alignment and no end mark of strings; CDR begins with
// four bytes that tell the byte order, and counts alignment from behind them.
class FieldReader {
 public:
  explicit FieldReader(const MessageBytes& message)
      : is_cdr_(message.serialization == Serialization::kCdr),
        fields_(is_cdr_ ? body(message) : message.bytes, message.source, layout(message)) {}

  template <typename T>
  T take() {
    return fields_.take<T>();
  }

  std::string_view text() {
    std::string_view text = fields_.take_text();
    if (is_cdr_ && text.ends_with('\0')) text.remove_suffix(1);
    return text;
  }

  ByteView block() { return fields_.take_block(); }

  std::int64_t stamp() {
    if (!is_cdr_) take<std::uint32_t>();  // number of the message
    const auto seconds = is_cdr_ ? take<std::int32_t>() : std::int64_t{take<std::uint32_t>()};
    return seconds * kNanoseconds + take<std::uint32_t>();
  }

  void header() {
    stamp();
    text();  // frame_id
  }

  template <std::size_t N>
  void numbers(std::array<double, N>& values) {
    for (double& value : values) value = take<double>();
  }

 private:
  static ByteView body(const MessageBytes& message) {
    const ByteView bytes = message.bytes;
    if (bytes.size() < 4) throw InputError(std::string(message.source) + ": a message is empty");
    if (bytes[0] != 0 || bytes[1] > 1) {
      char kind[16];
      std::snprintf(kind, sizeof(kind), "0x%02x%02x", bytes[0], bytes[1]);
      throw InputError(std::string(message.source) +
                       ": a message is no plain CDR (it begins with " + kind + ")");
    }
    return bytes.subspan(4);
  }

  static ByteLayout layout(const MessageBytes& message) {
    if (message.serialization != Serialization::kCdr) return {};
    return {.big_endian = message.bytes[1] == 0, .aligned = true};
  }

  bool is_cdr_;
  ByteCursor fields_;
};

}  // namespace

std::int64_t read_stamp(const MessageBytes& message) { return FieldReader(message).stamp(); }

ImageMessage read_image_message(const MessageBytes& message) {
  FieldReader reader(message);
  reader.header();
  ImageMessage image;
  image.height = reader.take<std::uint32_t>();
  image.width = reader.take<std::uint32_t>();
  image.encoding = reader.text();
  image.big_endian = reader.take<std::uint8_t>() != 0;
  image.step = reader.take<std::uint32_t>();
  image.data = reader.block();
  return image;
}

ByteView read_compressed_image(const MessageBytes& message) {
  FieldReader reader(message);
  reader.header();
  reader.text();  // format: the data tell it themselves
  return reader.block();
}

CameraInfoMessage read_camera_info(const MessageBytes& message) {
  FieldReader reader(message);
  reader.header();
  CameraInfoMessage info;
  info.height = reader.take<std::uint32_t>();
  info.width = reader.take<std::uint32_t>();
  info.distortion_model = printable(reader.text());
  const auto count = reader.take<std::uint32_t>();
  constexpr std::uint32_t kMost = 64;
  if (count > kMost) throw InputError(std::string(message.source) + ": CameraInfo: D is too long");
  for (std::uint32_t i = 0; i < count; ++i) info.d.push_back(reader.take<double>());
  reader.numbers(info.k);
  reader.numbers(info.r);
  reader.numbers(info.p);
  info.binning_x = reader.take<std::uint32_t>();
  info.binning_y = reader.take<std::uint32_t>();
  reader.take<std::uint32_t>();  // the region's x offset
  reader.take<std::uint32_t>();  // y offset
  info.roi_height = reader.take<std::uint32_t>();
  info.roi_width = reader.take<std::uint32_t>();
  return info;
}

}  // namespace hybrid_slam
