#include "apps/slam/frame_stream.h"

#include <algorithm>
#include <utility>

#include "apps/slam/give_way.h"

namespace hybrid_slam {
namespace {

// Inputs of a camera that wait for a thread at most, where the oldest are dropped.
constexpr std::ptrdiff_t kBacklog = 2;

// Likewise until a session has caught up with what came while it started.
constexpr std::ptrdiff_t kStartBacklog = 10;

// Inputs left out that wait to be told at most; more are counted alone.
constexpr std::size_t kLeftOutBacklog = 1000;

// Every so many moments, and in the first ones, stereo images are checked for being a pair.
constexpr std::int64_t kPairCheckPeriod = 32;
constexpr std::int64_t kFirstPairs = 3;

// So many inputs without enough of each camera: what is here must do.
constexpr std::size_t kStartAnyway = 20;

template <typename T>
bool has_size(const GrayImage& image, const Calibrated<T>& camera) {
  return image.width == camera.width && image.height == camera.height &&
         image.pixels.size() ==
             static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
}

template <typename T>
bool fits(const GrayImage& image, const GrayImage& mask, const Calibrated<T>& camera) {
  return has_size(image, camera) && (mask.empty() || has_size(mask, camera));
}

}  // namespace

FrameStream::FrameStream(const CameraRig& cameras, const SlamOptions& options,
                         const FrameStreamOptions& stream)
    : cameras_(cameras),
      options_(options),
      stream_(stream),
      window_(static_cast<std::size_t>(std::max(stream.threads, 1)) + 1),
      buffer_(stream.reorder, cameras.fisheye.has_value()) {
  for (int i = 0; i < std::max(stream.threads, 1); ++i) {
    threads_.emplace_back([this] { work(); });
  }
}

FrameStream::~FrameStream() { cancel(); }

PushResult FrameStream::push(SensorInput input) {
  const PushResult complaint = check(input);
  const CameraKind camera = camera_of(input);
  const Nanoseconds time = time_of(input);
  Lock lock(mutex_);
  if (complaint != PushResult::kTaken) {
    ++counts_of(camera).refused;
    leave_out(camera, time, to_string(complaint));
    return complaint;
  }
  if (!stream_.drop) {
    changed_.wait(lock, [this] {
      return closed_ || cancelled_ || failure_ || in_flight() < window_ ||
             !(starting_ || can_begin());
    });
  }
  if (closed_ || cancelled_ || failure_) return PushResult::kClosed;
  const PushResult result = buffer_.add(std::move(input), Clock::now());
  StreamCounts& counts = counts_of(camera);
  counts.taken += result == PushResult::kTaken ? 1 : 0;
  counts.late += result == PushResult::kLate ? 1 : 0;
  counts.duplicate += result == PushResult::kDuplicate ? 1 : 0;
  if (result != PushResult::kTaken) leave_out(camera, time, to_string(result));
  release(false);
  changed_.notify_all();
  return result;
}

PushResult FrameStream::check(const SensorInput& input) const {
  if (camera_of(input) == CameraKind::kFisheye && !cameras_.fisheye) return PushResult::kNoCamera;
  bool good = true;
  if (const auto* pair = std::get_if<StereoImages>(&input)) {
    good = fits(pair->left, pair->mask, cameras_.stereo) && has_size(pair->right, cameras_.stereo);
  } else if (const auto* fisheye = std::get_if<FisheyeImage>(&input)) {
    good = fits(fisheye->image, fisheye->mask, *cameras_.fisheye);
  }
  return good ? PushResult::kTaken : PushResult::kWrongSize;
}

// Moves what is due from the buffer into the queue. With the lock held, as all below.
void FrameStream::release(bool flush) {
  while (auto input = buffer_.take(Clock::now(), flush)) append(std::move(*input));
}

void FrameStream::append(SensorInput input) {
  const Nanoseconds time = time_of(input);
  if (moment_ < 0 || time != moment_time_) ++moment_;
  moment_time_ = time;
  const bool first = !extractor_ && !std::holds_alternative<ExtractedFrame>(input);
  Released released{camera_of(input), time, moment_, first, {}};
  if (auto* pair = std::get_if<StereoImages>(&input)) {
    auto shared = std::make_shared<const StereoImages>(std::move(*pair));
    if (first && first_.stereo.size() < FirstImages::kStereo) first_.stereo.push_back(shared);
    released.image = std::move(shared);
  } else if (auto* fisheye = std::get_if<FisheyeImage>(&input)) {
    auto shared = std::make_shared<const FisheyeImage>(std::move(*fisheye));
    if (first && first_.fisheye.size() < FirstImages::kFisheye) first_.fisheye.push_back(shared);
    released.image = std::move(shared);
  } else {
    released.image = std::move(std::get<ExtractedFrame>(input));
  }
  released_.push_back(std::move(released));
  if (stream_.drop) drop_oldest(released_.back().camera);
}

void FrameStream::drop_oldest(CameraKind camera) {
  const auto droppable = [&](const Released& one) { return one.camera == camera && !one.first; };
  auto waiting = std::count_if(released_.begin(), released_.end(), droppable);
  caught_up_ = caught_up_ || waiting > kStartBacklog;
  if (!caught_up_) return;
  for (; waiting > kBacklog; --waiting) {
    const auto oldest = std::find_if(released_.begin(), released_.end(), droppable);
    leave_out(camera, oldest->time, kDropped);
    released_.erase(oldest);
    ++counts_of(camera).dropped;
  }
}

void FrameStream::leave_out(CameraKind camera, Nanoseconds time, const char* reason) {
  if (left_out_.size() < kLeftOutBacklog) left_out_.push_back({camera, time, reason});
  changed_.notify_all();
}

// Whether the next one can be extracted: the first ones wait for one another.
bool FrameStream::can_begin() const {
  if (starting_) return false;
  if (extractor_ || settle_now_ || closed_ || released_.size() >= kStartAnyway) return true;
  if (!released_.empty() && std::holds_alternative<ExtractedFrame>(released_.front().image)) {
    return true;
  }
  return first_.stereo.size() >= FirstImages::kStereo &&
         (!cameras_.fisheye || first_.fisheye.size() >= FirstImages::kFisheye);
}

bool FrameStream::is_over() const {
  return cancelled_ || failure_ || (closed_ && buffer_.size() == 0 && released_.empty());
}

// Waits for something to extract; none if nothing comes any more.
std::optional<FrameStream::Released> FrameStream::take(Lock& lock) {
  while (!is_over()) {
    if (!released_.empty() && can_begin() && begun_ - consumed_ < window_) {
      if (!extractor_ && !std::holds_alternative<ExtractedFrame>(released_.front().image)) {
        make_extractor(lock);
        continue;
      }
      Released input = std::move(released_.front());
      released_.pop_front();
      caught_up_ = caught_up_ || released_.empty();
      return input;
    }
    if (const auto due = buffer_.next_due()) {
      changed_.wait_until(lock, *due);
      release(false);
    } else {
      changed_.wait(lock);
    }
  }
  return std::nullopt;
}

void FrameStream::make_extractor(Lock& lock) {
  starting_ = true;
  const FirstImages first = first_;
  lock.unlock();
  auto made = std::make_unique<FrameExtractor>(cameras_, options_, stream_.device, first,
                                               stream_.known_alignment);
  lock.lock();
  extractor_ = std::move(made);
  first_ = {};
  starting_ = false;
  changed_.notify_all();
}

void FrameStream::work() {
  give_way();
  StageTimes times;
  Lock lock(mutex_);
  try {
    while (auto input = take(lock)) {
      const std::size_t ticket = begun_++;
      lock.unlock();
      CameraFrame frame = extract(std::move(*input), times);
      lock.lock();
      ready_.emplace(ticket, std::move(frame));
      changed_.notify_all();
    }
  } catch (...) {
    if (!lock.owns_lock()) lock.lock();
    failure_ = std::current_exception();
  }
  times_.merge(times);
  changed_.notify_all();
}

CameraFrame FrameStream::extract(Released input, StageTimes& times) {
  const auto frame_of = [&]() -> CameraFrame {
    if (auto* extracted = std::get_if<ExtractedFrame>(&input.image)) {
      return {extracted->camera, extracted->time, std::move(extracted->frame)};
    }
    const auto* pair = std::get_if<std::shared_ptr<const StereoImages>>(&input.image);
    return pair != nullptr
               ? extractor_->extract(
                     **pair, input.moment < kFirstPairs || input.moment % kPairCheckPeriod == 0,
                     times)
               : extractor_->extract(*std::get<std::shared_ptr<const FisheyeImage>>(input.image),
                                     times);
  };
  CameraFrame frame = frame_of();
  frame.frame.index = input.moment;
  frame.frame.time = to_seconds(frame.time);
  return frame;
}

std::optional<StreamItem> FrameStream::next() {
  Lock lock(mutex_);
  changed_.wait(lock, [this] {
    return cancelled_ || failure_ || !left_out_.empty() || ready_.contains(consumed_) ||
           (is_over() && begun_ == consumed_);
  });
  if (failure_) std::rethrow_exception(failure_);
  StreamItem item;
  item.left_out = std::exchange(left_out_, {});
  const auto at = ready_.find(consumed_);
  if (cancelled_ || at == ready_.end()) {
    return cancelled_ || item.left_out.empty() ? std::nullopt : std::optional(std::move(item));
  }
  item.frame = std::move(at->second);
  ready_.erase(at);
  ++consumed_;
  ++given_;
  changed_.notify_all();
  return item;
}

void FrameStream::done() {
  const Lock lock(mutex_);
  --given_;
}

void FrameStream::flush() {
  const Lock lock(mutex_);
  settle_now_ = true;
  release(true);
  changed_.notify_all();
}

void FrameStream::close() {
  const Lock lock(mutex_);
  closed_ = true;
  release(true);
  changed_.notify_all();
}

void FrameStream::cancel() {
  const Lock lock(mutex_);
  closed_ = cancelled_ = true;
  changed_.notify_all();
}

StreamCounts FrameStream::counts(CameraKind camera) const {
  const Lock lock(mutex_);
  return counts_[static_cast<int>(camera)];
}

std::size_t FrameStream::waiting() const {
  const Lock lock(mutex_);
  return buffer_.size() + in_flight() + given_;
}

StageTimes FrameStream::times() {
  threads_.clear();
  return times_;
}

std::optional<UpsamplingEvidence> FrameStream::upsampling() const {
  const Lock lock(mutex_);
  return extractor_ ? std::optional(extractor_->upsampling()) : std::nullopt;
}

bool FrameStream::upsamples() const {
  const Lock lock(mutex_);
  return extractor_ ? extractor_->upsamples() : options_.sift.upsample;
}

}  // namespace hybrid_slam
