#include "apps/report/jpeg_encoder.h"

#include <csetjmp>
#include <cstddef>
#include <cstdio>  // which jpeglib.h needs and does not include
#include <cstdlib>
#include <stdexcept>

#include <jpeglib.h>

namespace hybrid_slam {
namespace {

// libjpeg's own record of errors, followed by ours.
struct EncoderErrors {
  jpeg_error_mgr manager;  // first: libjpeg hands out a pointer to it
  std::jmp_buf failed;
};

struct JpegWriter {
  jpeg_compress_struct jpeg{};
  unsigned char* bytes = nullptr;  // libjpeg makes them
  unsigned long size = 0;
  ~JpegWriter() {
    jpeg_destroy_compress(&jpeg);
    std::free(bytes);
  }
};

[[noreturn]] void on_encoder_error(j_common_ptr jpeg) {
  std::longjmp(reinterpret_cast<EncoderErrors*>(jpeg->err)->failed, 1);
}

// libjpeg reports errors by a jump to setjmp(): what is made after it here needs no destructor.
bool encode(const GrayImage& image, int quality, JpegWriter& writer) {
  EncoderErrors errors;
  writer.jpeg.err = jpeg_std_error(&errors.manager);
  errors.manager.error_exit = on_encoder_error;
  if (setjmp(errors.failed) != 0) return false;
  jpeg_create_compress(&writer.jpeg);
  jpeg_mem_dest(&writer.jpeg, &writer.bytes, &writer.size);
  writer.jpeg.image_width = static_cast<JDIMENSION>(image.width);
  writer.jpeg.image_height = static_cast<JDIMENSION>(image.height);
  writer.jpeg.input_components = 1;
  writer.jpeg.in_color_space = JCS_GRAYSCALE;
  jpeg_set_defaults(&writer.jpeg);
  jpeg_set_quality(&writer.jpeg, quality, TRUE);
  writer.jpeg.optimize_coding = TRUE;
  jpeg_start_compress(&writer.jpeg, TRUE);
  for (int y = 0; y < image.height; ++y) {
    auto* row = const_cast<JSAMPROW>(image.row(y));  // which libjpeg reads
    jpeg_write_scanlines(&writer.jpeg, &row, 1);
  }
  jpeg_finish_compress(&writer.jpeg);
  return true;
}

}  // namespace

std::string encode_jpeg(const GrayImage& image, int quality) {
  if (image.empty()) throw std::logic_error("an empty image is no JPEG file");
  JpegWriter writer;
  if (!encode(image, quality, writer)) throw std::logic_error("the image is not encoded");
  return {reinterpret_cast<const char*>(writer.bytes), writer.size};
}

}  // namespace hybrid_slam
