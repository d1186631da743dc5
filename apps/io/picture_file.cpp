#include "apps/io/picture_file.h"

#include <png.h>
#include <zlib.h>

#include <csetjmp>
#include <exception>
#include <stdexcept>
#include <string>

#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

// libpng's memory of what it writes.
struct PngWriter {
  png_structp png = nullptr;
  png_infop info = nullptr;
  ~PngWriter() { png_destroy_write_struct(&png, &info); }
};

void append(png_structp png, png_bytep bytes, png_size_t count) {
  try {
    static_cast<std::string*>(png_get_io_ptr(png))
        ->append(reinterpret_cast<const char*>(bytes), count);
  } catch (const std::exception&) {  // must not pass through libpng
    png_error(png, "too little memory");
  }
}

void flush(png_structp) {}

// False if libpng reports an error, which it does by a jump to setjmp(): what is made after it here
// needs no destructor.
bool encode_png(const cv::Mat& picture, std::string& file) {
  PngWriter writer;
  writer.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  if (writer.png != nullptr) writer.info = png_create_info_struct(writer.png);
  if (writer.info == nullptr || setjmp(png_jmpbuf(writer.png)) != 0) return false;
  png_set_write_fn(writer.png, &file, append, flush);
  png_set_IHDR(writer.png, writer.info, static_cast<png_uint_32>(picture.cols),
               static_cast<png_uint_32>(picture.rows), 8,
               picture.channels() == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  // Drawings are mostly of one colour: fast, and as small as with more effort.
  png_set_compression_level(writer.png, Z_BEST_SPEED);
  png_set_compression_strategy(writer.png, Z_RLE);
  png_set_filter(writer.png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_write_info(writer.png, writer.info);
  png_set_bgr(writer.png);
  for (int y = 0; y < picture.rows; ++y) png_write_row(writer.png, picture.ptr(y));
  png_write_end(writer.png, nullptr);
  return true;
}

}  // namespace

void write_picture(const std::filesystem::path& path, const cv::Mat& picture) {
  if (picture.type() != CV_8UC3 && picture.type() != CV_8UC1) {
    throw std::logic_error("the picture is neither in colour nor grey");
  }
  std::string file;
  if (!encode_png(picture, file)) throw std::logic_error("the picture is not encoded");
  write_file(path, file);
}

}  // namespace hybrid_slam
