#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <set>
#include <thread>

#include <catch2/catch.hpp>

#include "backend/map/map_file.h"
#include "test/backend/same_map.h"
#include "test/support/filled_map.h"
#include "test/support/random.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

Map make_map(int times) {
  SyntheticSceneOptions options;
  options.times = times;
  return std::move(fill_map(make_synthetic_scene(options), {}).map);
}

// Another process that saves the one and the other map, again and again, until it is killed. It has
// begun when this returns.
pid_t start_saving(const fs::path& path, const Map& one, const Map& other) {
  int begun[2];
  REQUIRE(pipe(begun) == 0);
  const pid_t pid = fork();
  if (pid != 0) {
    close(begun[1]);
    char byte = 0;
    const bool is_saving = read(begun[0], &byte, 1) == 1;
    close(begun[0]);
    REQUIRE(pid > 0);
    REQUIRE(is_saving);
    return pid;
  }
  try {
    for (bool first = true;; first = false) {
      save_map(path, one.view(), {"one", ""});
      if (first && write(begun[1], "!", 1) != 1) _exit(1);
      save_map(path, other.view(), {"other", ""});
    }
  } catch (...) {
    _exit(1);
  }
}

// Kills the saving process `kills` times at random moments; each time one of the two maps must be
// there, whole.
void check_kills(int kills) {
  const TempFolder folder;
  const fs::path path = folder.path() / "map";
  const Map one = make_map(12);
  const Map other = make_map(10);
  Random random(3);
  int interrupted = 0;
  std::set<std::string> found;
  save_map(path, one.view(), {"one", ""});
  for (int i = 0; i < kills; ++i) {
    const pid_t pid = start_saving(path, one, other);
    std::this_thread::sleep_for(std::chrono::microseconds(random.below(30000)));
    kill(pid, SIGKILL);
    int status = 0;
    REQUIRE(waitpid(pid, &status, 0) == pid);
    REQUIRE(WIFSIGNALED(status));
    const LoadedMap loaded = load_map(path);
    found.insert(loaded.info.program);
    check_same_map(loaded.map.view(), loaded.info.program == "one" ? one.view() : other.view());
    for (const auto& entry : fs::directory_iterator(folder.path())) {
      if (entry.path() == path) continue;
      ++interrupted;  // a temporary file: it was killed while saving
      fs::remove(entry.path());
    }
  }
  INFO("killed while saving: " << interrupted << " of " << kills);
  CHECK(interrupted > 0);
  CHECK((kills < 20 || found.size() == 2));
}

TEST_CASE("kill -9 while saving leaves the old map or the new one") { check_kills(8); }

TEST_CASE("kill -9 at 100 random moments leaves the old map or the new one", "[slow]") {
  check_kills(100);
}

}  // namespace
}  // namespace hybrid_slam
