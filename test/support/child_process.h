#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

namespace hybrid_slam {

// What a program left behind.
struct Outcome {
  int code = -1;         // its exit code; -1 if a signal ended it
  int signal = 0;        // that signal; SIGKILL if it did not end in time
  std::string out, err;  // all it printed
};

// Another program, started in the working folder `folder`, without a shell and with no input.
class ChildProcess {
 public:
  ChildProcess(const std::string& program, const std::vector<std::string>& arguments,
               const std::filesystem::path& folder);
  ~ChildProcess();  // killed if it still runs
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  // Waits until the program has printed `text` to stderr. False if it ended before, or after
  // `limit`.
  bool wait_for_error_text(const std::string& text, std::chrono::seconds limit);

  void send(int signal) const;

  // Waits for its end; kills it after `limit`. Once.
  Outcome finish(std::chrono::seconds limit);

 private:
  bool has_ended();

  std::filesystem::path out_, err_;
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
};

// Starts a program and waits for it, two minutes at most.
Outcome run_program(const std::string& program, const std::vector<std::string>& arguments,
                    const std::filesystem::path& folder);

}  // namespace hybrid_slam
