#include "cameras/files/output_file.h"

#include <sys/resource.h>

#include <csignal>

#include <catch2/catch.hpp>

#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

TEST_CASE("a file is replaced whole and nothing is left beside it") {
  const TempFolder folder;
  write_file(folder.path() / "a", "old");
  write_file(folder.path() / "a", std::string(1 << 20, 'x'));
  CHECK(read_text(folder.path() / "a") == std::string(1 << 20, 'x'));
  CHECK(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()) == 1);
}

TEST_CASE("what cannot be written throws one line with the name, and leaves nothing behind") {
  const TempFolder folder;
  const auto refused = [](const fs::path& path) {
    try {
      write_file(path, "text");
    } catch (const OutputError& error) {
      const std::string line = error.what();
      return line.find(path.string()) == 0 && line.find('\n') == std::string::npos;
    }
    return false;
  };
  CHECK(refused(folder.path() / "missing" / "a"));
  fs::create_directory(folder.path() / "folder");
  CHECK(refused(folder.path() / "folder"));
  CHECK(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()) == 1);
}

// A disk that is full, as far as a program can see: no file may grow beyond `bytes`.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  void (*handler_)(int);
  rlimit before_{};
};

TEST_CASE("when the disk is full the older file survives") {
  const TempFolder folder;
  const fs::path path = folder.path() / "a";
  write_file(path, "old");
  {
    const FileSizeLimit limit(1 << 16);
    CHECK_THROWS_AS(write_file(path, std::string(1 << 20, 'x')), OutputError);
  }
  CHECK(read_text(path) == "old");
  CHECK(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()) == 1);
}

TEST_CASE("a file that is not committed never was") {
  const TempFolder folder;
  {
    OutputFile file(folder.path() / "a");
    file.write("text");
  }
  CHECK(fs::is_empty(folder.path()));
}

}  // namespace
}  // namespace hybrid_slam
