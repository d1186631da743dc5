#include "frontend/input/bags/chunk_codec.h"

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <memory>
#include <new>
#include <optional>
#include <span>

#include "cameras/files/printable.h"

namespace hybrid_slam {

namespace {

constexpr std::uint64_t kMaxChunk = std::uint64_t{1} << 30;  // [bytes]; recorders write megabytes

// A decompressor that goes on from where it stands: what it has read and written, and whether the
// data are at their end.
struct Step {
  std::size_t read = 0;
  std::size_t written = 0;
  bool is_end = false;
  bool is_damaged = false;
};

// The bytes of compressed data, of which there should be `size`. Memory grows with what is really
// there: a damaged size costs nothing. Empty where it is not so.
template <typename Decompressor>
std::optional<ByteVector> decompress_by(Decompressor decompressor, ByteView data,
                                        std::uint64_t size) {
  constexpr std::size_t kFirst = 1 << 16;
  ByteVector result(std::min<std::uint64_t>(size, kFirst));
  std::size_t written = 0;
  for (;;) {
    const std::span<std::uint8_t> room(result.data() + written, result.size() - written);
    const Step step = decompressor(data, room);
    if (step.is_damaged) return std::nullopt;
    data = data.subspan(step.read);
    written += step.written;
    if (step.is_end) break;
    if (written == result.size() && written < size) {
      result.resize(std::min<std::uint64_t>(size, 2 * result.size()));
    } else if (step.read == 0 && step.written == 0) {
      return std::nullopt;  // cut off, or more than `size`
    }
  }
  if (written != size) return std::nullopt;
  return result;
}

class Bz2Decompressor {
 public:
  Bz2Decompressor() : stream_(new bz_stream{}) {
    if (BZ2_bzDecompressInit(stream_.get(), 0, 0) != BZ_OK) throw std::bad_alloc();
  }

  Step operator()(ByteView data, std::span<std::uint8_t> room) {
    constexpr std::size_t kMost = 1 << 30;  // at once; the library's numbers have 32 bits
    data = data.first(std::min(data.size(), kMost));
    // The library's interface knows no const.
    stream_->next_in = const_cast<char*>(reinterpret_cast<const char*>(data.data()));
    stream_->avail_in = static_cast<unsigned>(data.size());
    stream_->next_out = reinterpret_cast<char*>(room.data());
    stream_->avail_out = static_cast<unsigned>(room.size());
    const int result = BZ2_bzDecompress(stream_.get());
    return {data.size() - stream_->avail_in, room.size() - stream_->avail_out,
            result == BZ_STREAM_END, result != BZ_OK && result != BZ_STREAM_END};
  }

 private:
  struct End {
    void operator()(bz_stream* stream) const {
      BZ2_bzDecompressEnd(stream);
      delete stream;
    }
  };
  std::unique_ptr<bz_stream, End> stream_;
};

class Lz4Decompressor {
 public:
  Lz4Decompressor() {
    LZ4F_dctx* context = nullptr;
    if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) {
      throw std::bad_alloc();
    }
    context_.reset(context);
  }

  Step operator()(ByteView data, std::span<std::uint8_t> room) {
    std::size_t read = data.size(), written = room.size();
    const std::size_t hint =
        LZ4F_decompress(context_.get(), room.data(), &written, data.data(), &read, nullptr);
    return {read, written, hint == 0, LZ4F_isError(hint) != 0};
  }

 private:
  struct End {
    void operator()(LZ4F_dctx* context) const { LZ4F_freeDecompressionContext(context); }
  };
  std::unique_ptr<LZ4F_dctx, End> context_;
};

class ZstdDecompressor {
 public:
  ZstdDecompressor() : stream_(ZSTD_createDStream()) {
    if (!stream_) throw std::bad_alloc();
  }

  Step operator()(ByteView data, std::span<std::uint8_t> room) {
    ZSTD_inBuffer in{data.data(), data.size(), 0};
    ZSTD_outBuffer out{room.data(), room.size(), 0};
    const std::size_t hint = ZSTD_decompressStream(stream_.get(), &out, &in);
    return {in.pos, out.pos, hint == 0 && in.pos == in.size, ZSTD_isError(hint) != 0};
  }

 private:
  struct End {
    void operator()(ZSTD_DStream* stream) const { ZSTD_freeDStream(stream); }
  };
  std::unique_ptr<ZSTD_DStream, End> stream_;
};

}  // namespace

bool is_stored(const std::string& compression) {
  return compression.empty() || compression == "none";
}

bool is_known_compression(const std::string& compression) {
  return is_stored(compression) || compression == "bz2" || compression == "lz4" ||
         compression == "zstd";
}

ByteVector decompress(const std::string& compression, ByteView data, std::uint64_t size,
                      const std::string& source) {
  if (!is_known_compression(compression)) {
    throw InputError(source + ": a chunk is compressed by \"" + printable(compression) +
                     "\", which cannot be read (none, bz2, lz4 and zstd can)");
  }
  if (size > kMaxChunk) throw InputError(source + ": a chunk has an impossible size");
  auto result = compression == "bz2"   ? decompress_by(Bz2Decompressor(), data, size)
                : compression == "lz4" ? decompress_by(Lz4Decompressor(), data, size)
                                       : decompress_by(ZstdDecompressor(), data, size);
  if (!result) throw InputError(source + ": a chunk (" + compression + ") is damaged");
  return *std::move(result);
}

bool is_zstd_frame(ByteView data) {
  constexpr std::uint8_t kMagic[] = {0x28, 0xb5, 0x2f, 0xfd};
  return data.size() >= sizeof(kMagic) &&
         std::equal(std::begin(kMagic), std::end(kMagic), data.begin());
}

ByteVector decompress_zstd_frame(ByteView data, const std::string& source) {
  const std::uint64_t size = ZSTD_getFrameContentSize(data.data(), data.size());
  if (size == ZSTD_CONTENTSIZE_UNKNOWN || size == ZSTD_CONTENTSIZE_ERROR) {
    throw InputError(source + ": a compressed message does not tell its size");
  }
  return decompress("zstd", data, size, source);
}

}  // namespace hybrid_slam
