#pragma once

#include <sys/prctl.h>

#include <functional>
#include <string>
#include <thread>
#include <utility>

namespace hybrid_slam {

// A thread of one job, which is waited for where this ends. For rooms beside this one, which make
// no threads of their own.
class Background {
 public:
  // `name`: as top -H shows it, up to 15 characters; threads that the job makes inherit it.
  Background(std::string name, std::function<void()> job)
      : thread_([name = std::move(name), job = std::move(job)] {
          prctl(PR_SET_NAME, name.c_str());
          job();
        }) {}

 private:
  std::jthread thread_;
};

}  // namespace hybrid_slam
