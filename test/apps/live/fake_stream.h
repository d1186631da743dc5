#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include "apps/slam/live/grabber.h"
#include "cameras/files/input_error.h"

namespace hybrid_slam {

// A camera as a test wants it: an image each period, whose first pixel counts them. It can be
// unplugged.
struct FakeCamera {
  std::chrono::milliseconds period{20};
  std::chrono::milliseconds delay{0};  // of all its images
  int width = 4;
  int waiting = 0;  // images that each connection holds at first
  double says_rate = 0;
  std::atomic<bool> plugged{true};
  std::atomic<int> opened{0};
};

class FakeStream final : public ImageStream {
 public:
  using Clock = std::chrono::steady_clock;

  explicit FakeStream(std::shared_ptr<FakeCamera> camera)
      : camera_(std::move(camera)), waiting_(camera_->waiting) {
    if (!camera_->plugged) throw InputError("fake: cannot be opened");
    ++camera_->opened;
  }

  // Of all cameras at the same moments, however busy the machine is.
  std::optional<StreamImage> next() override {
    Clock::time_point time = Clock::now();
    if (waiting_-- <= 0) {
      const auto period = std::chrono::duration_cast<Clock::duration>(camera_->period);
      const auto now = (time.time_since_epoch() - camera_->delay) / period;
      number_ = (number_ == 0 ? now : number_) + 1;  // none is left out
      time = Clock::time_point(number_ * period + camera_->delay);
      std::this_thread::sleep_until(time);
    }
    if (!camera_->plugged) return std::nullopt;
    StreamImage image{{camera_->width, 2, {}}, time, std::nullopt};
    image.image.pixels.assign(static_cast<std::size_t>(2 * camera_->width),
                              static_cast<std::uint8_t>(number_ % 251));
    return image;
  }

  double rate() const override { return camera_->says_rate; }

 private:
  std::shared_ptr<FakeCamera> camera_;
  int waiting_ = 0;
  std::int64_t number_ = 0;
};

inline StreamSpec fake_spec(LiveCamera camera, const std::shared_ptr<FakeCamera>& fake) {
  return {camera,
          std::string("fake ") + to_string(camera),
          [fake] { return std::make_unique<FakeStream>(fake); },
          false,
          true,
          0};
}

}  // namespace hybrid_slam
