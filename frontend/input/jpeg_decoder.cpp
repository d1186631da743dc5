#include <csetjmp>
#include <cstddef>
#include <cstdio>  // which jpeglib.h needs and does not include

#include <jpeglib.h>

#include <jerror.h>

#include "frontend/input/image_decoders.h"

namespace hybrid_slam {
namespace {

// libjpeg's own record of errors, followed by ours.
struct JpegErrors {
  jpeg_error_mgr manager;  // first: libjpeg hands out a pointer to it
  std::jmp_buf failed;
  char text[JMSG_LENGTH_MAX];
};

struct JpegReader {
  jpeg_decompress_struct jpeg{};
  ~JpegReader() { jpeg_destroy_decompress(&jpeg); }
};

[[noreturn]] void on_jpeg_error(j_common_ptr jpeg) {
  auto* const errors = reinterpret_cast<JpegErrors*>(jpeg->err);
  errors->manager.format_message(jpeg, errors->text);
  std::longjmp(errors->failed, 1);
}

// Warnings that tell of missing pixels are errors; libjpeg would make some up.
void on_jpeg_message(j_common_ptr jpeg, int level) {
  if (level >= 0) return;
  switch (jpeg->err->msg_code) {
    case JWRN_JPEG_EOF:
    case JWRN_HIT_MARKER:
    case JWRN_HUFF_BAD_CODE:
    case JWRN_MUST_RESYNC:
      on_jpeg_error(jpeg);
    default:
      break;
  }
}

}  // namespace

// libjpeg reports errors by a jump to setjmp(): what is made after it here needs no destructor.
std::string decode_jpeg(std::span<const std::uint8_t> file, GrayChannel channel,
                        const MakeRoom& make_room, DecodedImage& image) {
  std::vector<std::uint8_t> colors;  // of a row; here, as a jump would pass its destructor by
  JpegErrors errors{};
  JpegReader reader;
  jpeg_decompress_struct& jpeg = reader.jpeg;
  jpeg.err = jpeg_std_error(&errors.manager);
  errors.manager.error_exit = on_jpeg_error;
  errors.manager.emit_message = on_jpeg_message;
  if (setjmp(errors.failed) != 0) {
    return errors.manager.msg_code == JWRN_JPEG_EOF
               ? "truncated JPEG"
               : "damaged JPEG (" + std::string(errors.text) + ")";
  }
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, file.data(), static_cast<unsigned long>(file.size()));
  jpeg_read_header(&jpeg, TRUE);
  // A block of 64 pixels takes at least a bit; four times that is allowed, as libjpeg's own memory
  // is.
  if (!can_hold(file.size(), 4 * std::uint64_t{jpeg.image_width} * jpeg.image_height)) {
    return "truncated JPEG";
  }
  make_room(jpeg.image_width, jpeg.image_height, image.gray);
  const bool one_channel = channel != GrayChannel::kGrey && jpeg.num_components == 3;
  jpeg.out_color_space = one_channel ? JCS_RGB : JCS_GRAYSCALE;
  if (one_channel) colors.resize(3 * std::size_t{jpeg.image_width});
  jpeg_start_decompress(&jpeg);
  while (jpeg.output_scanline < jpeg.output_height) {
    std::uint8_t* const gray = image.gray.row(static_cast<int>(jpeg.output_scanline));
    JSAMPROW row = one_channel ? colors.data() : gray;
    jpeg_read_scanlines(&jpeg, &row, 1);
    for (std::size_t x = 0; 3 * x < colors.size(); ++x) {
      gray[x] = gray_of(colors[3 * x], colors[3 * x + 1], colors[3 * x + 2], channel);
    }
  }
  jpeg_finish_decompress(&jpeg);
  return {};
}

}  // namespace hybrid_slam
