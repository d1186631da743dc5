#include "frontend/place_recognition/vocabulary_file.h"

#include <xxhash.h>
#include <zstd.h>

#include <bit>
#include <cstring>
#include <stdexcept>

#include "backend/map/byte_stream.h"
#include "cameras/files/input_error.h"
#include "cameras/files/output_file.h"
#include "frontend/place_recognition/mapped_file.h"
#include "frontend/place_recognition/vocabulary_text.h"

namespace hybrid_slam {
namespace {

static_assert(std::endian::native == std::endian::little,
              "the tables lie in the file as in memory");

constexpr std::string_view kMagic = "HSLAMVOC";
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kHeaderSize = 64;
constexpr std::size_t kAlignment = 64;
constexpr std::uint64_t kMaxRatio = 256;  // of content to what is stored, as in a map file
constexpr int kCompressionLevel = 19;     // written once, read often

enum Codec : std::uint32_t { kStored = 0, kZstd = 1 };

std::uint64_t checksum_of(std::string_view bytes) {
  return XXH3_64bits(bytes.data(), bytes.size());
}

struct Header {
  std::uint32_t kind = 0;
  std::uint32_t element_size = 0;  // bytes per number of a descriptor: 1 or 4
  std::uint32_t branching = 0;
  std::uint32_t levels = 0;
  std::uint32_t nodes = 0;
  std::uint32_t codec = kStored;
  std::uint64_t stored_size = 0;  // of what follows the header
  std::uint64_t checksum = 0;     // of that
};

std::string encode(const Header& header) {
  ByteWriter out;
  out.bytes(kMagic);
  out.number(kVersion);
  for (const std::uint32_t value : {header.kind, header.element_size, header.branching,
                                    header.levels, header.nodes, header.codec}) {
    out.number(value);
  }
  out.number(std::uint32_t{0});
  out.number(header.stored_size);
  out.number(header.checksum);
  out.number(checksum_of(out.content()));
  return out.content();
}

Header decode_header(std::string_view file, const std::string& name) {
  if (file.size() < kHeaderSize) throw InputError(name + ": the file is cut off");
  ByteReader in(file.substr(0, kHeaderSize), name);
  in.bytes(kMagic.size());
  const auto version = in.number<std::uint32_t>();
  Header header;
  for (std::uint32_t* value : {&header.kind, &header.element_size, &header.branching,
                               &header.levels, &header.nodes, &header.codec}) {
    *value = in.number<std::uint32_t>();
  }
  in.number<std::uint32_t>();
  header.stored_size = in.number<std::uint64_t>();
  header.checksum = in.number<std::uint64_t>();
  if (in.number<std::uint64_t>() != checksum_of(file.substr(0, kHeaderSize - 8))) {
    in.fail("wrong checksum of the header");
  }
  if (version != kVersion) {
    in.fail("version " + std::to_string(version) + " of the format, not " +
            std::to_string(kVersion));
  }
  if (header.element_size != 1 && header.element_size != 4) in.fail("descriptors of unknown size");
  if (header.codec > kZstd) in.fail("unknown codec");
  if (header.kind > static_cast<std::uint32_t>(DescriptorKind::kPlainSift)) {
    in.fail("unknown kind of descriptor");
  }
  return header;
}

// Where the tables lie after the header.
struct Layout {
  explicit Layout(std::uint64_t nodes, std::uint64_t element_size)
      : weights(aligned((nodes + 1) * sizeof(NodeId))),
        descriptors(weights + aligned(nodes * sizeof(float))),
        size(descriptors + nodes * element_size * std::tuple_size_v<Descriptor>) {}

  std::uint64_t weights, descriptors, size;

 private:
  static std::uint64_t aligned(std::uint64_t size) {
    return (size + kAlignment - 1) / kAlignment * kAlignment;
  }
};

template <typename T>
std::span<const T> table_at(std::string_view content, std::uint64_t offset, std::size_t count) {
  return {reinterpret_cast<const T*>(content.data() + offset), count};
}

template <typename T>
std::string_view bytes_of(std::span<const T> table) {
  return {reinterpret_cast<const char*>(table.data()), table.size_bytes()};
}

Vocabulary from_content(const Header& header, std::string_view content,
                        std::shared_ptr<const void> owner, const std::string& name) {
  const Layout layout(header.nodes, header.element_size);
  if (content.size() != layout.size) throw InputError(name + ": the sizes do not fit together");
  VocabularyTables tables;
  tables.kind = static_cast<DescriptorKind>(header.kind);
  tables.branching = static_cast<int>(header.branching);
  tables.levels = static_cast<int>(header.levels);
  tables.first_child = table_at<NodeId>(content, 0, std::size_t{header.nodes} + 1);
  tables.weights = table_at<float>(content, layout.weights, header.nodes);
  if (header.element_size == 1) {
    tables.bytes = table_at<Descriptor>(content, layout.descriptors, header.nodes);
  } else {
    tables.floats = table_at<FloatDescriptor>(content, layout.descriptors, header.nodes);
  }
  const std::string wrong = tables.validate();
  if (!wrong.empty()) throw InputError(name + ": " + wrong);
  return Vocabulary(tables, std::move(owner));
}

// `owner` keeps `file` alive.
Vocabulary read_binary(std::string_view file, std::shared_ptr<const void> owner,
                       const std::string& name) {
  const Header header = decode_header(file, name);
  const std::string_view stored = file.substr(kHeaderSize);
  if (stored.size() < header.stored_size) throw InputError(name + ": the file is cut off");
  if (stored.size() > header.stored_size) throw InputError(name + ": more follows the vocabulary");
  if (checksum_of(stored) != header.checksum) throw InputError(name + ": wrong checksum");
  if (header.codec == kStored) return from_content(header, stored, std::move(owner), name);

  const std::uint64_t size = Layout(header.nodes, header.element_size).size;
  if (size / kMaxRatio > stored.size()) throw InputError(name + ": the sizes do not fit together");
  // Memory from new is aligned for every table.
  const auto content = std::make_shared<std::vector<char>>(size);
  const std::size_t unpacked = ZSTD_decompress(content->data(), size, stored.data(), stored.size());
  if (ZSTD_isError(unpacked) != 0 || unpacked != size) {
    throw InputError(name + ": cannot be decompressed");
  }
  return from_content(header, {content->data(), size}, content, name);
}

// What follows the header, in pieces.
std::vector<std::string_view> pieces_of(const VocabularyTables& tables) {
  static constexpr char kZeros[kAlignment] = {};
  const auto padding = [](std::string_view table) {
    return std::string_view(kZeros, (kAlignment - table.size() % kAlignment) % kAlignment);
  };
  const std::string_view first_child = bytes_of(tables.first_child);
  const std::string_view weights = bytes_of(tables.weights);
  return {first_child,      padding(first_child),   weights,
          padding(weights), bytes_of(tables.bytes), bytes_of(tables.floats)};
}

// Empty if what comes of it is so small that the reader would refuse it.
std::string compress(const std::vector<std::string_view>& pieces) {
  std::string content;
  for (const std::string_view piece : pieces) content.append(piece);
  std::string packed(ZSTD_compressBound(content.size()), '\0');
  const std::size_t size = ZSTD_compress(packed.data(), packed.size(), content.data(),
                                         content.size(), kCompressionLevel);
  if (ZSTD_isError(size) != 0) {
    throw std::logic_error(std::string("vocabulary: zstd: ") + ZSTD_getErrorName(size));
  }
  packed.resize(content.size() / kMaxRatio < size ? size : 0);
  return packed;
}

std::uint64_t checksum_of(const std::vector<std::string_view>& pieces) {
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(),
                                                                       &XXH3_freeState);
  XXH3_64bits_reset(state.get());
  for (const std::string_view piece : pieces) {
    XXH3_64bits_update(state.get(), piece.data(), piece.size());
  }
  return XXH3_64bits_digest(state.get());
}

void write_binary(OutputFile& file, const VocabularyTables& tables, bool compressed) {
  std::vector<std::string_view> pieces = pieces_of(tables);
  Header header{static_cast<std::uint32_t>(tables.kind),
                tables.bytes.empty() ? std::uint32_t{sizeof(float)} : 1,
                static_cast<std::uint32_t>(tables.branching),
                static_cast<std::uint32_t>(tables.levels),
                static_cast<std::uint32_t>(tables.nodes())};
  std::string packed;
  if (compressed) packed = compress(pieces);
  if (!packed.empty()) {
    pieces = {packed};
    header.codec = kZstd;
  }
  for (const std::string_view piece : pieces) header.stored_size += piece.size();
  header.checksum = checksum_of(pieces);
  file.write(encode(header));
  for (const std::string_view piece : pieces) file.write(piece);
}

}  // namespace

void save_vocabulary(const std::filesystem::path& path, const Vocabulary& vocabulary,
                     VocabularyFormat format) {
  OutputFile file(path);
  if (format == VocabularyFormat::kText) {
    write_vocabulary_text(vocabulary, [&](std::string_view piece) { file.write(piece); });
  } else {
    write_binary(file, vocabulary.tables(), format == VocabularyFormat::kCompressed);
  }
  file.commit();
}

Vocabulary load_vocabulary(const std::filesystem::path& path,
                           std::optional<DescriptorKind> expected) {
  const auto file = std::make_shared<MappedFile>(path);
  const std::string name = path.string();
  const bool binary = file->bytes().substr(0, kMagic.size()) == kMagic;
  const Vocabulary vocabulary =
      binary ? read_binary(file->bytes(), file, name) : read_vocabulary_text(file->bytes(), name);
  if (expected && vocabulary.kind() != *expected) {
    throw InputError(name + ": a vocabulary of " + std::string(kind_name(vocabulary.kind())) +
                     " descriptors is of no use to " + std::string(kind_name(*expected)) +
                     " descriptors");
  }
  return vocabulary;
}

Vocabulary read_vocabulary(std::string_view bytes, const std::string& name) {
  if (bytes.substr(0, kMagic.size()) != kMagic) throw InputError(name + ": not a vocabulary");
  return read_binary(bytes, nullptr, name);
}

}  // namespace hybrid_slam
