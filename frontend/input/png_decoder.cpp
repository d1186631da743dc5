#include <png.h>

#include <csetjmp>
#include <cstring>

#include "frontend/input/image_decoders.h"

namespace hybrid_slam {
namespace {

// What libpng's callbacks share: the file, and what was wrong.
struct PngState {
  std::span<const std::uint8_t> left;  // not yet read
  bool truncated = false;
  std::string reason;
};

// The reader's memory in libpng.
struct PngReader {
  png_structp png = nullptr;
  png_infop info = nullptr;
  ~PngReader() { png_destroy_read_struct(&png, &info, nullptr); }
};

[[noreturn]] void on_png_error(png_structp png, png_const_charp text) {
  static_cast<PngState*>(png_get_error_ptr(png))->reason = text;
  png_longjmp(png, 1);
}

void on_png_warning(png_structp, png_const_charp) {}

void read_png(png_structp png, png_bytep to, png_size_t count) {
  auto& state = *static_cast<PngState*>(png_get_io_ptr(png));
  if (state.left.size() < count) {
    state.truncated = true;
    png_error(png, "it ends early");
  }
  std::memcpy(to, state.left.data(), count);
  state.left = state.left.subspan(count);
}

// Samples of up to 8 bits become one grey byte per pixel.
void make_gray(png_structp png, GrayChannel channel) {
  png_set_strip_alpha(png);
  png_set_expand(png);  // palettes to colours, fewer bits to 8
  constexpr int kSilently = 1;
  switch (channel) {  // the weights of red and green; blue has the rest
    case GrayChannel::kGrey:
      return png_set_rgb_to_gray(png, kSilently, 0.299, 0.587);
    case GrayChannel::kRed:
      return png_set_rgb_to_gray(png, kSilently, 1, 0);
    case GrayChannel::kGreen:
      return png_set_rgb_to_gray(png, kSilently, 0, 1);
    case GrayChannel::kBlue:
      return png_set_rgb_to_gray(png, kSilently, 0, 0);
  }
}

// Samples of 16 bits, in the machine's order of bytes.
void make_wide(png_structp png, png_infop info, GrayChannel channel, DecodedImage& image) {
  png_set_strip_alpha(png);
  png_set_swap(png);
  const bool is_color = (png_get_color_type(png, info) & PNG_COLOR_MASK_COLOR) != 0;
  constexpr int kSilently = 1;
  const bool weigh = is_color && channel == GrayChannel::kGrey;
  if (weigh) png_set_rgb_to_gray(png, kSilently, 0.299, 0.587);
  image.make_wide(is_color && !weigh ? 3 : 1);
}

png_bytep row_of(DecodedImage& image, int y) {
  if (!image.is_wide()) return image.gray.row(y);
  const auto row = static_cast<std::size_t>(y) * static_cast<std::size_t>(image.gray.width);
  return reinterpret_cast<png_bytep>(
      &image.samples[row * static_cast<std::size_t>(image.channels)]);
}

}  // namespace

// libpng reports errors by a jump to setjmp(): what is made after it here needs no destructor.
std::string decode_png(std::span<const std::uint8_t> file, GrayChannel channel,
                       const MakeRoom& make_room, DecodedImage& image) {
  PngState state{file, false, {}};
  PngReader reader;
  reader.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &state, on_png_error, on_png_warning);
  if (reader.png != nullptr) reader.info = png_create_info_struct(reader.png);
  if (reader.info == nullptr) return "PNG cannot be decoded (too little memory)";
  if (setjmp(png_jmpbuf(reader.png)) != 0) {
    return state.truncated ? "truncated PNG" : "damaged PNG (" + state.reason + ")";
  }
  png_set_read_fn(reader.png, &state, read_png);
  png_set_crc_action(reader.png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
  png_read_info(reader.png, reader.info);
  make_room(png_get_image_width(reader.png, reader.info),
            png_get_image_height(reader.png, reader.info), image.gray);
  if (png_get_bit_depth(reader.png, reader.info) == 16) {
    if (!can_hold(file.size(), 2 * std::uint64_t{image.gray.pixels.size()} *
                                   png_get_channels(reader.png, reader.info))) {
      return "truncated PNG";
    }
    make_wide(reader.png, reader.info, channel, image);
  } else {
    make_gray(reader.png, channel);
  }
  const int passes = png_set_interlace_handling(reader.png);
  png_read_update_info(reader.png, reader.info);
  const int pixel_bytes = image.is_wide() ? 2 * image.channels : 1;
  if (png_get_rowbytes(reader.png, reader.info) !=
      static_cast<std::size_t>(pixel_bytes) * static_cast<std::size_t>(image.gray.width)) {
    png_error(reader.png, "unknown kind of pixels");
  }
  for (int pass = 0; pass < passes; ++pass) {
    for (int y = 0; y < image.gray.height; ++y) png_read_row(reader.png, row_of(image, y), nullptr);
  }
  png_read_end(reader.png, nullptr);
  return {};
}

}  // namespace hybrid_slam
