#include <tiffio.h>

#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>

#include "cameras/files/printable.h"
#include "frontend/input/image_decoders.h"

// TIFF with 8 or 16 bits per sample, grey or RGB, in strips; libtiff undoes compressions.
namespace hybrid_slam {
namespace {

// What libtiff's callbacks share: the file, and the first complaint.
struct TiffState {
  std::span<const std::uint8_t> file;
  std::size_t at = 0;
  std::string reason;
};

thread_local TiffState* current = nullptr;  // libtiff's handlers of errors know no file

void on_tiff_error(const char*, const char* format, va_list arguments) {
  char text[200];
  std::vsnprintf(text, sizeof(text), format, arguments);
  if (current != nullptr && current->reason.empty()) current->reason = printable(text);
}

tmsize_t read_tiff(thandle_t handle, void* to, tmsize_t count) {
  auto& state = *static_cast<TiffState*>(handle);
  const std::size_t left = state.file.size() - state.at;
  const std::size_t read = std::min(left, static_cast<std::size_t>(count));
  std::memcpy(to, state.file.data() + state.at, read);
  state.at += read;
  return static_cast<tmsize_t>(read);
}

tmsize_t write_tiff(thandle_t, void*, tmsize_t) { return 0; }

toff_t seek_tiff(thandle_t handle, toff_t offset, int whence) {
  auto& state = *static_cast<TiffState*>(handle);
  const std::size_t base = whence == SEEK_CUR   ? state.at
                           : whence == SEEK_END ? state.file.size()
                                                : 0;
  state.at = std::min(base + static_cast<std::size_t>(offset), state.file.size());
  return state.at;
}

int close_tiff(thandle_t) { return 0; }

toff_t size_tiff(thandle_t handle) { return static_cast<TiffState*>(handle)->file.size(); }

struct CloseTiff {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};

struct TiffKind {
  std::uint16_t bits = 1, samples = 1, planes = PLANARCONFIG_CONTIG, photometric = 0, format = 1;
};

TiffKind kind_of(TIFF* tiff) {
  TiffKind kind;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &kind.bits);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &kind.samples);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &kind.planes);
  TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &kind.photometric);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &kind.format);
  return kind;
}

bool is_read(TIFF* tiff, const TiffKind& kind) {
  const bool is_color = kind.photometric == PHOTOMETRIC_RGB;
  const bool is_gray =
      kind.photometric == PHOTOMETRIC_MINISBLACK || kind.photometric == PHOTOMETRIC_MINISWHITE;
  return TIFFIsTiled(tiff) == 0 && (kind.bits == 8 || kind.bits == 16) &&
         kind.format == SAMPLEFORMAT_UINT &&
         (kind.planes == PLANARCONFIG_CONTIG || kind.samples == 1) &&
         (is_color ? kind.samples >= 3 : is_gray && kind.samples >= 1);
}

// One row as it was decoded, into the image.
void take_row(const std::vector<std::uint8_t>& row, const TiffKind& kind, GrayChannel channel,
              int y, DecodedImage& image) {
  const auto width = static_cast<std::size_t>(image.gray.width);
  const int white = kind.bits == 8 ? 255 : 65535;
  const auto sample = [&](std::size_t i) {
    std::uint16_t value = row[i];
    if (kind.bits == 16) std::memcpy(&value, &row[2 * i], 2);  // libtiff has put its bytes in order
    return kind.photometric == PHOTOMETRIC_MINISWHITE ? white - value : int{value};
  };
  const bool is_color = kind.photometric == PHOTOMETRIC_RGB;
  for (std::size_t x = 0; x < width; ++x) {
    const std::size_t first = x * kind.samples;
    if (image.is_wide()) {
      const auto channels = static_cast<std::size_t>(image.channels);
      for (std::size_t c = 0; c < channels; ++c) {
        image.samples[(static_cast<std::size_t>(y) * width + x) * channels + c] =
            static_cast<std::uint16_t>(sample(first + c));
      }
    } else {
      image.gray.row(y)[x] =
          is_color ? gray_of(sample(first), sample(first + 1), sample(first + 2), channel)
                   : static_cast<std::uint8_t>(sample(first));
    }
  }
}

std::string decode(TiffState& state, GrayChannel channel, const MakeRoom& make_room,
                   DecodedImage& image) {
  const std::unique_ptr<TIFF, CloseTiff> tiff(TIFFClientOpen("TIFF", "rm", &state, read_tiff,
                                                             write_tiff, seek_tiff, close_tiff,
                                                             size_tiff, nullptr, nullptr));
  if (!tiff) return "damaged or truncated TIFF (" + state.reason + ")";
  std::uint32_t width = 0, height = 0;
  TIFFGetField(tiff.get(), TIFFTAG_IMAGEWIDTH, &width);
  TIFFGetField(tiff.get(), TIFFTAG_IMAGELENGTH, &height);
  const TiffKind kind = kind_of(tiff.get());
  if (!is_read(tiff.get(), kind)) {
    return "this kind of TIFF is not read (8 or 16 bits, grey or RGB, in strips are)";
  }
  make_room(width, height, image.gray);
  const auto row_size = static_cast<std::uint64_t>(TIFFScanlineSize(tiff.get()));
  if (!can_hold(state.file.size(), row_size * height)) return "truncated TIFF";
  if (kind.bits == 16) image.make_wide(kind.photometric == PHOTOMETRIC_RGB ? 3 : 1);
  const auto needed = std::size_t{width} * kind.samples * (kind.bits / 8);
  std::vector<std::uint8_t> row(row_size);
  if (row.size() < needed) return "damaged TIFF (its rows are too short)";
  for (int y = 0; y < image.gray.height; ++y) {
    if (TIFFReadScanline(tiff.get(), row.data(), static_cast<std::uint32_t>(y)) != 1) {
      return "damaged or truncated TIFF (" + state.reason + ")";
    }
    take_row(row, kind, channel, y, image);
  }
  return {};
}

}  // namespace

std::string decode_tiff(std::span<const std::uint8_t> file, GrayChannel channel,
                        const MakeRoom& make_room, DecodedImage& image) {
  static const bool is_set_up = [] {
    TIFFSetErrorHandler(on_tiff_error);
    TIFFSetWarningHandler(nullptr);
    return true;
  }();
  static_cast<void>(is_set_up);
  TiffState state{file, 0, {}};
  current = &state;
  struct Forget {
    ~Forget() { current = nullptr; }
  } forget;
  return decode(state, channel, make_room, image);
}

}  // namespace hybrid_slam
