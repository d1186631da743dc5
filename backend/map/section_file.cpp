#include "backend/map/section_file.h"

#include <xxhash.h>
#include <zstd.h>

#include <stdexcept>

#include "backend/map/byte_stream.h"
#include "cameras/files/input_error.h"

namespace hybrid_slam {

namespace {

constexpr std::size_t kMagicSize = 8;
constexpr std::size_t kHeaderSize = kMagicSize + 4;
constexpr std::size_t kFooterSize = 8 + 8 + kMagicSize;
constexpr std::size_t kNameSize = 16;
constexpr std::size_t kEntrySize = kNameSize + 1 + 3 * 8;
constexpr int kCompressionLevel = 1;  // at 3, a map is 1 % smaller and takes four times as long

enum Codec : std::uint8_t { kStored = 0, kZstd = 1 };

// What one byte in the file may turn into. Sections that compress better are stored as they are, so
// that a reader may refuse what claims more.
constexpr std::uint64_t kMaxRatio = 256;

std::uint64_t checksum_of(std::string_view bytes) {
  return XXH3_64bits(bytes.data(), bytes.size());
}

// Names go into errors, which are one line.
bool is_word(std::string_view name) {
  return !name.empty() && name.find_first_not_of("abcdefghijklmnopqrstuvwxyz_") == name.npos;
}

// Empty if compressing does not pay, or pays too well.
std::string compress(std::string_view content) {
  std::string packed(ZSTD_compressBound(content.size()), '\0');
  const std::size_t size = ZSTD_compress(packed.data(), packed.size(), content.data(),
                                         content.size(), kCompressionLevel);
  if (ZSTD_isError(size) != 0) {
    throw std::logic_error(std::string("section file: zstd: ") + ZSTD_getErrorName(size));
  }
  if (size >= content.size() || content.size() / kMaxRatio >= size) return {};
  packed.resize(size);
  return packed;
}

}  // namespace

SectionFileWriter::SectionFileWriter(const std::filesystem::path& path,
                                     const SectionFileFormat& format)
    : file_(path), format_(format) {
  if (format.magic.size() != kMagicSize) throw std::logic_error("section file: wrong magic");
  ByteWriter header;
  header.bytes(format.magic);
  header.number(format.version);
  header_ = header.content();
  file_.write(header_);
}

void SectionFileWriter::add(std::string_view name, std::string_view content) {
  if (!is_word(name) || name.size() > kNameSize) throw std::logic_error("section file: wrong name");
  if (content.size() > kMaxSectionSize) throw std::length_error("section file: section too large");
  const std::string packed = compress(content);
  const std::string_view stored = packed.empty() ? content : std::string_view(packed);
  sections_.push_back({std::string(name), packed.empty() ? kStored : kZstd, stored.size(),
                       content.size(), checksum_of(stored)});
  file_.write(stored);
}

void SectionFileWriter::commit() {
  ByteWriter table;
  table.number(static_cast<std::uint32_t>(sections_.size()));
  for (const Section& section : sections_) {
    std::string name = section.name;
    name.resize(kNameSize, '\0');
    table.bytes(name);
    table.number(section.codec);
    table.number(section.stored_size);
    table.number(section.content_size);
    table.number(section.checksum);
  }
  table.number(static_cast<std::uint64_t>(table.content().size()));
  const std::uint64_t checksum = checksum_of(header_ + table.content());
  table.number(checksum);
  table.bytes(format_.magic);
  file_.write(table.content());
  file_.commit();
}

SectionFileReader::SectionFileReader(const std::filesystem::path& path,
                                     const SectionFileFormat& format)
    : path_(path) {
  std::error_code error;
  size_ = std::filesystem::file_size(path, error);  // an error for a folder, too
  if (!error) file_.open(path, std::ios::binary);
  if (error || !file_) fail("cannot be read");
  read_header(format);
  read_table(format);
}

void SectionFileReader::read_header(const SectionFileFormat& format) {
  if (size_ < kHeaderSize + kFooterSize) {
    fail("too short to be a " + std::string(format.name));
  }
  header_ = read_bytes(0, kHeaderSize);
  ByteReader header(header_, path_.string());
  if (header.bytes(kMagicSize) != format.magic) fail("no " + std::string(format.name));
  version_ = header.number<std::uint32_t>();
  if (version_ < format.oldest || version_ > format.version) {
    const std::string known =
        format.oldest < format.version ? std::to_string(format.oldest) + " to " : std::string();
    fail("version " + std::to_string(version_) + " of the format, where this program knows " +
         known + std::to_string(format.version));
  }
}

void SectionFileReader::read_table(const SectionFileFormat& format) {
  const std::string footer = read_bytes(size_ - kFooterSize, kFooterSize);
  ByteReader end(footer, path_.string() + ": end");
  const auto table_size = end.number<std::uint64_t>();
  const auto checksum = end.number<std::uint64_t>();
  if (end.bytes(kMagicSize) != format.magic) fail("its end is missing: cut off or damaged");
  const std::uint64_t inner = size_ - kHeaderSize - kFooterSize;
  if (table_size > inner) fail("section table: larger than the file");
  const std::string bytes = read_bytes(size_ - kFooterSize - table_size, table_size);
  if (checksum_of(header_ + bytes + footer.substr(0, 8)) != checksum) {
    fail("section table: wrong checksum: the file is damaged");
  }
  ByteReader table(bytes, path_.string() + ": section table");
  const std::size_t count = table.count<std::uint32_t>(kEntrySize);
  std::uint64_t offset = kHeaderSize;
  for (std::size_t i = 0; i < count; ++i) {
    Section section;
    section.name = table.bytes(kNameSize);
    section.name.resize(section.name.find_last_not_of('\0') + 1);
    if (!is_word(section.name)) table.fail("a name that is no word");
    section.codec = table.number<std::uint8_t>();
    section.stored_size = table.number<std::uint64_t>();
    section.content_size = table.number<std::uint64_t>();
    section.checksum = table.number<std::uint64_t>();
    if (section.stored_size > kHeaderSize + inner - table_size - offset) {
      table.fail("sections larger than the file");
    }
    sections_.push_back(section);
    offsets_.push_back(offset);
    offset += section.stored_size;
  }
  if (!table.at_end() || offset != size_ - kFooterSize - table_size) {
    table.fail("does not fit the file's size");
  }
}

std::string SectionFileReader::read(std::size_t index) {
  const Section& section = sections_.at(index);
  const ByteReader errors({}, place(index));
  const bool stored = section.codec == kStored && section.content_size == section.stored_size;
  const bool packed =
      section.codec == kZstd && section.content_size / kMaxRatio < section.stored_size;
  if (section.content_size > kMaxSectionSize || !(stored || packed)) {
    errors.fail("absurd size or unknown compression");
  }
  std::string bytes = read_bytes(offsets_[index], section.stored_size);
  if (checksum_of(bytes) != section.checksum) errors.fail("wrong checksum: the file is damaged");
  if (stored) return bytes;
  std::string content(section.content_size, '\0');
  const std::size_t size =
      ZSTD_decompress(content.data(), content.size(), bytes.data(), bytes.size());
  if (ZSTD_isError(size) != 0 || size != content.size()) errors.fail("cannot be decompressed");
  return content;
}

std::string SectionFileReader::place(std::size_t index) const {
  return path_.string() + ": section " + std::to_string(index + 1) + " (" +
         sections_.at(index).name + ")";
}

std::string SectionFileReader::read_bytes(std::uint64_t offset, std::uint64_t size) {
  std::string bytes(size, '\0');
  file_.seekg(static_cast<std::streamoff>(offset));
  file_.read(bytes.data(), static_cast<std::streamsize>(size));
  if (!file_) fail("cannot be read");
  return bytes;
}

void SectionFileReader::fail(const std::string& reason) const {
  throw InputError(path_.string() + ": " + reason);
}

}  // namespace hybrid_slam
