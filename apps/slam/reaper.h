#pragma once

#include <memory>
#include <thread>
#include <utility>

#include "apps/slam/channel.h"

namespace hybrid_slam {

// Frees what the last holder gave up in a thread of its own: whoever lets go of a map, tracking
// above all, does not pay for it. After the reaper's end things are freed where they are let go.
class Reaper {
 public:
  Reaper()
      : thread_([given_up = given_up_] {
          while (given_up->pop()) {
          }
        }) {}
  ~Reaper() { given_up_->close(); }
  Reaper(const Reaper&) = delete;
  Reaper& operator=(const Reaper&) = delete;

  // The same thing, to be freed by the reaper. Null stays null.
  template <typename T>
  std::shared_ptr<const T> adopt(std::shared_ptr<const T> value) {
    const T* const at = value.get();
    if (at == nullptr) return nullptr;
    return {at, [value = std::move(value), given_up = given_up_](const T*) mutable {
              given_up->try_push(std::move(value));
            }};
  }

 private:
  static constexpr std::size_t kBacklog = 256;
  using GivenUp = Channel<std::shared_ptr<const void>>;

  std::shared_ptr<GivenUp> given_up_ = std::make_shared<GivenUp>(kBacklog);
  std::jthread thread_;
};

}  // namespace hybrid_slam
