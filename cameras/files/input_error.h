#pragma once

#include <stdexcept>

namespace hybrid_slam {

// Bad input from outside. what() is one line: file, place, reason.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace hybrid_slam
