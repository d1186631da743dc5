#include "apps/slam/live/set_recorder.h"

#include <sys/resource.h>

#include <catch2/catch.hpp>
#include <csignal>

#include "cameras/files/output_file.h"
#include "frontend/input/image_file.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

GrayImage noise(int width, int height) {
  GrayImage image{width, height, {}};
  for (int i = 0; i < width * height; ++i) {
    image.pixels.push_back(static_cast<std::uint8_t>((i * 7919 + i * i) % 251));
  }
  return image;
}

ImageSet set_of(std::int64_t stamp) {
  ImageSet set{{stamp, noise(64, 48), {}}, {stamp + 1, noise(60, 48), {}}};
  set.fisheye = StampedImage{stamp + 2, noise(50, 50), {}};
  return set;
}

std::size_t files_in(const fs::path& folder) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

}  // namespace

TEST_CASE("A recorded set has its left image's time, and the pixels that came") {
  const TempFolder folder;
  write_text(folder.path() / "a/cam.yaml", "left");
  write_text(folder.path() / "b/cam.yaml", "right");
  const std::vector<std::string> calibration{(folder.path() / "a/cam.yaml").string(),
                                             (folder.path() / "b/cam.yaml").string()};
  SetRecorder recorder(folder.path() / "r", calibration, true);
  const ImageSet set = set_of(1'700'000'000'123'456'789);
  CHECK(recorder.add(set).empty());
  for (const char* const camera : {"left", "right", "fisheye"}) {
    const GrayImage image =
        read_gray_image(folder.path() / "r" / camera / "1700000000123456789.png");
    const StampedImage& original = *camera == 'l'   ? set.left
                                   : *camera == 'r' ? set.right
                                                    : *set.fisheye;
    CHECK(image.pixels == original.image.pixels);
  }
  REQUIRE(recorder.calibration().size() == 2);
  CHECK(read_text(recorder.calibration()[1]) == "right");
  CHECK_THROWS_WITH(SetRecorder(folder.path() / "r", calibration, true),
                    Catch::Contains("holds something already"));
}

TEST_CASE("A full disk ends the recording with the sets that are whole") {
  const TempFolder folder;
  SetRecorder recorder(folder.path() / "r", {}, true);
  CHECK(recorder.add(set_of(1)).empty());
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{1000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &limit);
  const std::string failure = recorder.add(set_of(2));
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  CHECK_THAT(failure, Catch::Contains("cannot be written") &&
                          Catch::Contains("the recording ends with 1 sets, and the run goes on"));
  CHECK(recorder.failed());
  CHECK(recorder.add(set_of(3)).empty());  // said once
  CHECK(recorder.recorded() == 1);
  for (const char* const camera : {"left", "right", "fisheye"}) {
    CHECK(files_in(folder.path() / "r" / camera) == 1);
  }
}

}  // namespace hybrid_slam
