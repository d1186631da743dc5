#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <unordered_set>
#include <vector>

#include "apps/slam/live/set_pairing.h"
#include "frontend/input/footage_images.h"
#include "frontend/input/image_file.h"

namespace hybrid_slam {

struct WatchOptions {
  std::string left, right;  // folders or patterns
  std::string fisheye;      // empty: there is none
  double timeout = 10;      // [s] in which there must be a set
  double rate = 0;          // [Hz] that makes times of numbers in the names; 0: none
  double tolerance = 0;     // [s], as match_stamps() takes it
  ImageReading reading;
};

// Sets from folders that a recorder is writing to; names tell times or numbers as those of own
// footage do. A file is taken for complete when its size stands still between two looks and it can
// be decoded, or was renamed to its name; one that stands still for two seconds and cannot be
// decoded is damaged. How often it looks follows from how long that takes: a twentieth of the time.
class WatchedSource final : public SetSource {
 public:
  WatchedSource(WatchOptions options);

  std::optional<ImageSet> next(const std::stop_token& stop) override;
  LiveCounts counts() const override;

 private:
  using Clock = std::chrono::steady_clock;
  struct PendingFile {
    std::filesystem::path path;
    std::uintmax_t size = 0;  // when it was looked at last
  };
  struct Folder {
    std::string source;
    std::unordered_set<std::size_t> seen;  // hashes of the names
    std::vector<PendingFile> pending;      // by their names
    std::filesystem::path first;
    std::optional<NameOrder> order;
    std::optional<std::int64_t> newest;  // stamp
    bool told_late = false;
  };

  void look();
  void look_at(LiveCamera camera);
  void add(LiveCamera camera, const std::vector<std::filesystem::path>& complete);
  std::int64_t stamp_of(const FootageImage& image, NameOrder order, const Folder& folder);
  std::optional<ImageSet> take();
  bool load(ImageSet& set);
  GrayImage read(const StampedImage& image);
  void look_for_silence();
  std::string why_nothing_belongs_together() const;

  const WatchOptions options_;
  SetPairing pairing_;
  PerCamera<Folder> folders_;
  LiveCounts counts_;
  ImageReading reading_;
  std::int64_t unix_start_ = 0;
  std::optional<std::int64_t> first_number_;
  std::string unclear_;           // why images could not be brought together so far
  std::optional<ImageSet> next_;  // not decoded yet
  Clock::time_point since_;       // next_ could not be decoded, or there was nothing
  bool silent_ = false;
  bool started_ = false;
};

}  // namespace hybrid_slam
