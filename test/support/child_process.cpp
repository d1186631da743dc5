#include "test/support/child_process.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <stdexcept>
#include <thread>

#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

constexpr std::chrono::milliseconds kPause{5};

// In the child, where only calls that are safe after fork() are allowed.
[[noreturn]] void become(const char* program, char* const* arguments, const char* folder,
                         const char* out, const char* err) {
  const int input = open("/dev/null", O_RDONLY);
  const int output = open(out, O_WRONLY | O_CREAT | O_TRUNC, 0600);
  const int errors = open(err, O_WRONLY | O_CREAT | O_TRUNC, 0600);
  if (input >= 0 && output >= 0 && errors >= 0 && dup2(input, STDIN_FILENO) >= 0 &&
      dup2(output, STDOUT_FILENO) >= 0 && dup2(errors, STDERR_FILENO) >= 0 && chdir(folder) == 0) {
    execv(program, arguments);
  }
  _exit(127);
}

}  // namespace

ChildProcess::ChildProcess(const std::string& program, const std::vector<std::string>& arguments,
                           const std::filesystem::path& folder)
    : out_(folder / "printed.out"), err_(folder / "printed.err") {
  std::vector<std::string> words = arguments;
  words.insert(words.begin(), program);
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  for (const auto& file : {out_, err_}) std::filesystem::remove(file);  // of the program before
  pid_ = fork();
  if (pid_ < 0) throw std::runtime_error("fork failed");
  if (pid_ == 0) {
    become(program.c_str(), pointers.data(), folder.c_str(), out_.c_str(), err_.c_str());
  }
}

ChildProcess::~ChildProcess() {
  if (!has_ended()) {
    send(SIGKILL);
    waitpid(pid_, &status_, 0);
  }
}

bool ChildProcess::has_ended() {
  ended_ = ended_ || waitpid(pid_, &status_, WNOHANG) == pid_;
  return ended_;
}

bool ChildProcess::wait_for_error_text(const std::string& text, std::chrono::seconds limit) {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (std::chrono::steady_clock::now() < deadline) {
    const bool last = has_ended();
    if (std::filesystem::exists(err_) && read_text(err_).find(text) != std::string::npos) {
      return true;
    }
    if (last) return false;
    std::this_thread::sleep_for(kPause);
  }
  return false;
}

void ChildProcess::send(int signal) const { kill(pid_, signal); }

Outcome ChildProcess::finish(std::chrono::seconds limit) {
  const auto deadline = std::chrono::steady_clock::now() + limit;
  while (!has_ended()) {
    if (std::chrono::steady_clock::now() > deadline) {
      send(SIGKILL);
      ended_ = waitpid(pid_, &status_, 0) == pid_;
    }
    std::this_thread::sleep_for(kPause);
  }
  Outcome outcome;
  if (WIFEXITED(status_)) outcome.code = WEXITSTATUS(status_);
  if (WIFSIGNALED(status_)) outcome.signal = WTERMSIG(status_);
  if (std::filesystem::exists(out_)) outcome.out = read_text(out_);
  if (std::filesystem::exists(err_)) outcome.err = read_text(err_);
  return outcome;
}

Outcome run_program(const std::string& program, const std::vector<std::string>& arguments,
                    const std::filesystem::path& folder) {
  return ChildProcess(program, arguments, folder).finish(std::chrono::seconds(120));
}

}  // namespace hybrid_slam
