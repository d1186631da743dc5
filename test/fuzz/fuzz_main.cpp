#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "cameras/files/input_error.h"
#include "test/fuzz/fuzz_target.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

struct Folder {
  fs::path path;

  Folder() {
    std::string name = (fs::temp_directory_path() / "fuzz_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) std::abort();
    path = name;
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
};

// The contract of InputError. Any other exception passes through and ends the program.
void check(const InputError& error) {
  const std::string_view what = error.what();
  if (!what.empty() && what.find('\n') == std::string_view::npos) return;
  std::fprintf(stderr, "an InputError that is not one line:\n%s\n", error.what());
  std::abort();
}

}  // namespace

const fs::path& fuzz_folder() {
  static const Folder folder;
  return folder.path;
}

fs::path input_file(std::string_view input, const std::string& name) {
  fs::path path = fuzz_folder() / name;
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(input.data(), static_cast<std::streamsize>(input.size()));
  if (!file.flush()) std::abort();
  return path;
}

std::vector<fs::path> input_files(std::string_view input,
                                  std::initializer_list<std::string> names) {
  std::vector<fs::path> paths;
  for (const std::string& name : names) {
    const std::size_t end = input.find(kNextFile);
    const std::string_view content = input.substr(0, end);
    paths.push_back(fuzz_folder() / name);
    if (content == "-") {
      fs::remove(paths.back());
    } else {
      input_file(content, name);
    }
    input.remove_prefix(end == input.npos ? input.size() : end + kNextFile.size());
  }
  return paths;
}

void try_reading(const std::function<void()>& read) {
  try {
    read();
  } catch (const InputError& error) {
    check(error);
  }
}

}  // namespace hybrid_slam

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view input(reinterpret_cast<const char*>(data), size);
  hybrid_slam::try_reading([&] { hybrid_slam::read_input(input); });
  return 0;
}
