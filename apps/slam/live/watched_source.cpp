#include "apps/slam/live/watched_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <utility>

#include "cameras/files/input_error.h"
#include "frontend/input/image_decoders.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

using namespace std::chrono_literals;

constexpr auto kStandsStill = 2s;  // whoever writes a file writes something in this time

PairingOptions pairing_of(const WatchOptions& options) {
  PairingOptions pairing;
  pairing.stamps = StampKind::kSensor;
  pairing.fisheye = !options.fisheye.empty();
  pairing.tolerance = options.tolerance;
  pairing.most_waiting = 100'000;  // names alone
  return pairing;
}

// False if `stop` was requested meanwhile.
bool sleep(std::chrono::steady_clock::duration duration, const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any wake;
  std::unique_lock lock(mutex);
  wake.wait_for(lock, stop, duration, [] { return false; });
  return !stop.stop_requested();
}

// What is there now; a folder that is not there yet holds nothing.
std::vector<fs::path> files_now(const std::string& source) {
  try {
    return footage_files({source});
  } catch (const InputError&) {
    return {};
  } catch (const fs::filesystem_error&) {  // gone while we look
    return {};
  }
}

}  // namespace

WatchedSource::WatchedSource(WatchOptions options)
    : options_(std::move(options)),
      pairing_(pairing_of(options_)),
      reading_(options_.reading),
      unix_start_(std::chrono::duration_cast<std::chrono::nanoseconds>(
                      std::chrono::system_clock::now().time_since_epoch())
                      .count()),
      since_(Clock::now()) {
  of(folders_, LiveCamera::kLeft).source = options_.left;
  of(folders_, LiveCamera::kRight).source = options_.right;
  of(folders_, LiveCamera::kFisheye).source = options_.fisheye;
}

std::optional<ImageSet> WatchedSource::next(const std::stop_token& stop) {
  constexpr auto kLeastPause = 100ms;
  constexpr int kShare = 20;
  if (started_ && !next_) since_ = Clock::now();  // not while the SLAM was busy
  while (!stop.stop_requested()) {
    if (auto set = take()) return set;
    const auto begin = Clock::now();
    look();
    const auto effort = Clock::now() - begin;
    if (auto set = take()) return set;
    look_for_silence();
    if (!sleep(std::max<Clock::duration>(kLeastPause, kShare * effort), stop)) break;
  }
  return std::nullopt;
}

void WatchedSource::look() {
  for (const LiveCamera camera : kAllLiveCameras) {
    if (!of(folders_, camera).source.empty()) look_at(camera);
  }
}

// Files become complete in the order of their names. What is gone again is not waited for.
void WatchedSource::look_at(LiveCamera camera) {
  Folder& folder = of(folders_, camera);
  for (const fs::path& path : files_now(folder.source)) {
    const std::string name = path.filename().string();
    if (name.starts_with('.')) continue;  // still being copied, by some
    if (folder.seen.insert(std::hash<std::string>()(name)).second) {
      folder.pending.push_back({path, 0});
    }
  }
  std::erase_if(folder.pending, [](const PendingFile& file) {
    std::error_code error;
    return !fs::exists(file.path, error) && !error;
  });
  std::vector<fs::path> complete;
  auto at = folder.pending.begin();
  for (; at != folder.pending.end(); ++at) {
    std::error_code error;
    const std::uintmax_t size = fs::file_size(at->path, error);
    if (error || size == 0 || std::exchange(at->size, size) != size) break;
    complete.push_back(at->path);
  }
  for (auto rest = at; rest != folder.pending.end(); ++rest) {
    std::error_code error;
    const std::uintmax_t size = fs::file_size(rest->path, error);
    if (!error) rest->size = size;
  }
  folder.pending.erase(folder.pending.begin(), at);
  if (complete.empty()) return;
  try {
    add(camera, complete);
  } catch (const InputError& error) {
    if (!started_) throw;
    of(counts_.alone, camera) += static_cast<std::int64_t>(complete.size());
    tell(std::string(error.what()) + "; left out");
  }
}

// The first name stands beside the new ones, so that what changes in them shows.
void WatchedSource::add(LiveCamera camera, const std::vector<fs::path>& complete) {
  Folder& folder = of(folders_, camera);
  std::vector<fs::path> names = complete;
  if (folder.first.empty()) {
    folder.first = complete.front();
  } else {
    names.push_back(folder.first);
  }
  std::sort(names.begin(), names.end());
  const FootageList list = order_footage(names, names.front().string());
  if (!folder.order && !list.note.empty()) tell(list.note);
  if (!folder.order) folder.order = list.order;
  for (const FootageImage& image : list.images) {
    if (folder.newest && image.path == folder.first) continue;
    const std::int64_t stamp = stamp_of(image, list.order, folder);
    if (folder.newest && stamp <= *folder.newest) {
      ++of(counts_.alone, camera);
      if (!std::exchange(folder.told_late, true)) {
        tell(image.path.string() + ": comes after later ones, and is left out (said once)");
      }
      continue;
    }
    folder.newest = stamp;
    ++of(counts_.images, camera);
    pairing_.add(camera, {stamp, {}, image.path});
  }
}

std::int64_t WatchedSource::stamp_of(const FootageImage& image, NameOrder order,
                                     const Folder& folder) {
  if (order != *folder.order || order == NameOrder::kNames) {
    throw InputError(image.path.string() +
                     ": its name tells neither a time nor a number as the first one's does");
  }
  if (order == NameOrder::kStamps) return image.key;
  if (!(options_.rate > 0)) {
    throw InputError(image.path.string() +
                     ": the names tell numbers and no times; give --rate-hint HZ");
  }
  if (!first_number_) first_number_ = image.key;
  return unix_start_ +
         std::llround(1e9 * static_cast<double>(image.key - *first_number_) / options_.rate);
}

std::optional<ImageSet> WatchedSource::take() {
  if (!next_) {
    try {
      next_ = pairing_.take();
      unclear_.clear();
    } catch (const InputError& error) {  // more names may make it clear
      unclear_ = error.what();
    }
    for (const std::string& note : pairing_.notes()) tell(note);
    if (!next_) return std::nullopt;
    since_ = Clock::now();
  }
  if (!load(*next_)) return std::nullopt;
  since_ = Clock::now();
  started_ = true;
  silent_ = false;
  return std::exchange(next_, std::nullopt);
}

// False if an image cannot be decoded yet.
bool WatchedSource::load(ImageSet& set) {
  const bool damaged = Clock::now() - since_ > kStandsStill;
  try {
    for (StampedImage* const image : {&set.left, &set.right}) {
      if (image->image.empty()) image->image = read(*image);
    }
  } catch (const InputError& error) {
    if (!damaged) return false;
    set.error = error.what();
  }
  try {
    if (set.fisheye && set.fisheye->image.empty()) set.fisheye->image = read(*set.fisheye);
  } catch (const InputError& error) {
    if (!damaged) return false;
    set.fisheye_error = error.what();
    set.fisheye.reset();
  }
  return true;
}

GrayImage WatchedSource::read(const StampedImage& image) {
  DecodedImage decoded = decode_image_file(image.file, std::nullopt, reading_.channel);
  if (decoded.is_wide() && reading_.white == 0) {
    reading_.white = white_above(highest_sample(decoded));
    tell(fmt::format(
        "{}: has more than 8 bits; {} is taken for white, in all images (--white-level settles it)",
        image.file.string(), reading_.white));
  }
  return to_gray(std::move(decoded), reading_);
}

void WatchedSource::look_for_silence() {
  const std::chrono::duration<double> silence = Clock::now() - since_;
  if (silent_ || silence.count() < options_.timeout) return;
  if (started_) {
    silent_ = true;
    ++of(counts_.lost, LiveCamera::kLeft);
    tell(fmt::format("{}: no new images for {:.0f} s; it goes on when they come", options_.left,
                     silence.count()));
    return;
  }
  for (const LiveCamera camera : kAllLiveCameras) {
    if (of(folders_, camera).source.empty() || of(counts_.images, camera) > 0) continue;
    throw InputError(
        fmt::format("{}: no image of the {} camera came in {:g} s; --timeout waits longer",
                    of(folders_, camera).source, to_string(camera), options_.timeout));
  }
  throw InputError(options_.left + ": " + why_nothing_belongs_together());
}

// As if no more would come.
std::string WatchedSource::why_nothing_belongs_together() const {
  if (!unclear_.empty()) return unclear_;
  SetPairing all = pairing_;
  all.close();
  try {
    all.take();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no images came that belong together; --timeout waits longer";
}

LiveCounts WatchedSource::counts() const {
  LiveCounts counts = counts_;
  for (const LiveCamera camera : kAllLiveCameras) {
    of(counts.alone, camera) += of(pairing_.alone(), camera);
  }
  return counts;
}

}  // namespace hybrid_slam
