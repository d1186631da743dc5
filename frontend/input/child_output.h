#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace hybrid_slam {

// Another program, of which we read the output. It gets no input, and what it says on stderr is
// lost. It is ended with this object.
class ChildOutput {
 public:
  // The program, looked for in PATH, and its arguments. Throws InputError, "PROGRAM is not
  // installed" or why else it cannot be started.
  explicit ChildOutput(const std::vector<std::string>& command);
  ~ChildOutput();
  ChildOutput(const ChildOutput&) = delete;
  ChildOutput& operator=(const ChildOutput&) = delete;

  // Fills the buffer; returns fewer bytes only where the output ends.
  std::size_t read(std::span<std::uint8_t> buffer);

  // All that is left, as text, and whether the program ended well.
  bool read_to_end(std::string& text);

 private:
  bool wait();

  pid_t pid_ = -1;
  int output_ = -1;
};

}  // namespace hybrid_slam
