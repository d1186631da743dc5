#include <algorithm>
#include <optional>

#include "frontend/input/image_decoders.h"

// PGM and PPM, as text (P2, P3) or binary (P5, P6): netpbm's formats.
namespace hybrid_slam {
namespace {

class PnmReader {
 public:
  explicit PnmReader(std::span<const std::uint8_t> file) : left_(file.subspan(2)) {}

  // The next number of the header, or of a text image.
  std::optional<std::uint32_t> number() {
    skip_blanks();
    std::optional<std::uint32_t> value;
    while (!left_.empty() && left_[0] >= '0' && left_[0] <= '9') {
      if (value.value_or(0) > 100'000'000) return std::nullopt;
      value = 10 * value.value_or(0) + (left_[0] - '0');
      left_ = left_.subspan(1);
    }
    return value;
  }

  // The next sample of a binary image.
  std::optional<std::uint32_t> sample(bool two_bytes) {
    const std::size_t size = two_bytes ? 2 : 1;
    if (left_.size() < size) return std::nullopt;
    const std::uint32_t value = two_bytes ? 256U * left_[0] + left_[1] : left_[0];
    left_ = left_.subspan(size);
    return value;
  }

  void skip_byte() { left_ = left_.subspan(std::min<std::size_t>(1, left_.size())); }

 private:
  void skip_blanks() {
    while (!left_.empty() && (left_[0] <= ' ' || left_[0] == '#')) {
      if (left_[0] == '#') {
        while (!left_.empty() && left_[0] != '\n') left_ = left_.subspan(1);
      } else {
        left_ = left_.subspan(1);
      }
    }
  }

  std::span<const std::uint8_t> left_;
};

}  // namespace

std::string decode_pnm(std::span<const std::uint8_t> file, GrayChannel channel,
                       const MakeRoom& make_room, DecodedImage& image) {
  if (file.size() < 3) return "truncated PGM or PPM";
  const char kind = static_cast<char>(file[1]);
  PnmReader reader(file);
  const bool is_text = kind == '2' || kind == '3';
  const int channels = kind == '3' || kind == '6' ? 3 : 1;
  const auto width = reader.number(), height = reader.number(), white = reader.number();
  if (!width || !height || !white || *white == 0 || *white > 65535) {
    return "damaged or truncated PGM or PPM header";
  }
  const std::uint64_t samples = std::uint64_t{*width} * *height * static_cast<unsigned>(channels);
  if (samples > file.size()) return "truncated PGM or PPM";
  make_room(*width, *height, image.gray);
  if (*white > 255) image.make_wide(channels);
  if (!is_text) reader.skip_byte();
  const std::uint32_t full = *white > 255 ? 65535 : 255;
  for (std::size_t i = 0; i < image.gray.pixels.size(); ++i) {
    int values[3] = {};
    for (int c = 0; c < channels; ++c) {
      const auto sample = is_text ? reader.number() : reader.sample(*white > 255);
      if (!sample) return "truncated PGM or PPM";
      const std::uint32_t value = std::min(*sample, *white) * full / *white;
      values[c] = static_cast<int>(value);
      if (*white > 255) {
        image.samples[i * static_cast<std::size_t>(channels) + static_cast<std::size_t>(c)] =
            static_cast<std::uint16_t>(value);
      }
    }
    if (*white > 255) continue;
    image.gray.pixels[i] = channels == 1 ? static_cast<std::uint8_t>(values[0])
                                         : gray_of(values[0], values[1], values[2], channel);
  }
  return {};
}

}  // namespace hybrid_slam
