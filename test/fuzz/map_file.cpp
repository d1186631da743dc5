#include "backend/map/map_file.h"

#include "backend/map/map_file_format.h"
#include "frontend/input/text_file.h"
#include "test/fuzz/fuzz_target.h"

// Every byte of a map file is under a checksum: most changes are made to the content of a section,
// and the file is written anew.
namespace hybrid_slam {
namespace {

std::string with_changed_section(std::string_view file, std::size_t most, unsigned seed) {
  const std::filesystem::path path = input_file(file, "before");
  SectionFileReader reader(path, kMapFileFormat);
  if (reader.sections().empty()) throw InputError("no section to change");
  const std::size_t chosen = seed / 8 % reader.sections().size();
  const std::filesystem::path after = fuzz_folder() / "after";
  SectionFileWriter writer(after, kMapFileFormat);
  for (std::size_t i = 0; i < reader.sections().size(); ++i) {
    std::string content = reader.read(i);
    if (i == chosen) content = changed(content, std::min(most, content.size() + 64));
    writer.add(reader.sections()[i].name, content);
  }
  writer.commit();
  return read_file(after);
}

}  // namespace

void read_input(std::string_view input) { load_map(input_file(input)); }

}  // namespace hybrid_slam

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t most, unsigned seed) {
  const std::string_view file(reinterpret_cast<const char*>(data), size);
  if (seed % 8 != 0) {
    try {
      const std::string mended = hybrid_slam::with_changed_section(file, most, seed);
      if (mended.size() <= most) return hybrid_slam::hand_over(mended, data, most);
    } catch (const hybrid_slam::InputError&) {  // no map file
    }
  }
  return hybrid_slam::hand_over(hybrid_slam::changed(std::string(file), most), data, most);
}
