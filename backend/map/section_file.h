#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "cameras/files/output_file.h"

namespace hybrid_slam {

// A file of named sections, each compressed (zstd) and with a checksum (xxh3), in which no byte is
// without one. All numbers little endian:
//
//   magic          8 bytes
//   version        u32
//   sections       one after the other, as the table says
//   table          u32 count, then per section: name (16 bytes, filled up with zeros),
//                  u8 codec (0 as it is, 1 zstd), u64 bytes in the file, u64 bytes of content,
//                  u64 xxh3 of the bytes in the file
//   table's size   u64
//   checksum       u64 xxh3 of magic, version, table and table's size
//   magic          8 bytes, again: a file that was cut off is known at once
//
// The same content gives the same bytes (of the same version of zstd).
struct SectionFileFormat {
  std::string_view magic;  // 8 bytes
  std::uint32_t version = 1;
  std::string_view name;           // what such a file is called in errors: "map file"
  std::uint32_t oldest = version;  // that is still read
};

struct Section {
  std::string name;
  std::uint8_t codec = 0;
  std::uint64_t stored_size = 0;
  std::uint64_t content_size = 0;
  std::uint64_t checksum = 0;
};

// One section's content may not be larger [bytes]: what bounds the memory of both sides.
inline constexpr std::uint64_t kMaxSectionSize = std::uint64_t{1} << 28;

// Writes section by section; the file appears at commit(), see OutputFile. Throws OutputError, and
// std::length_error for a section that is too large.
class SectionFileWriter {
 public:
  SectionFileWriter(const std::filesystem::path& path, const SectionFileFormat& format);

  void add(std::string_view name, std::string_view content);  // name: 1 to 16 of a-z and _
  void commit();

 private:
  OutputFile file_;
  SectionFileFormat format_;
  std::string header_;
  std::vector<Section> sections_;
};

// Opening checks everything but the sections themselves, reading one checks that. Throws InputError
// "file: reason" or "file: section 3 (name): reason".
class SectionFileReader {
 public:
  SectionFileReader(const std::filesystem::path& path, const SectionFileFormat& format);

  const std::filesystem::path& path() const { return path_; }
  std::uint32_t version() const { return version_; }  // that the file has
  const std::vector<Section>& sections() const { return sections_; }

  // The content of a section. Allocates no more than kMaxSectionSize, nor more than a fixed
  // multiple of the bytes in the file.
  std::string read(std::size_t index);

  // "file: section 3 (name)".
  std::string place(std::size_t index) const;

 private:
  void read_header(const SectionFileFormat& format);
  void read_table(const SectionFileFormat& format);
  std::string read_bytes(std::uint64_t offset, std::uint64_t size);
  [[noreturn]] void fail(const std::string& reason) const;

  std::filesystem::path path_;
  std::ifstream file_;
  std::uint64_t size_ = 0;
  std::uint32_t version_ = 0;
  std::string header_;
  std::vector<Section> sections_;
  std::vector<std::uint64_t> offsets_;  // one per section
};

}  // namespace hybrid_slam
