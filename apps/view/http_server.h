#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>

// A small server of pages and of server-sent events (WHATWG HTML, "Server-sent events"), by
// cpp-httplib. Read-only: it answers GET alone.

namespace hybrid_slam {

struct ServerOptions {
  std::string address = "127.0.0.1";  // of this machine; only it is listened on
  int port = 8417;                    // 0: any that is free
};

// The address cannot be listened on; in one line.
class AddressError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// What is sent to one client who follows something. Used by one thread.
class EventStream {
 public:
  virtual ~EventStream() = default;

  // The next events as they are sent. Waits for them, a second at most: then it is empty. Null
  // where it is over.
  virtual std::shared_ptr<const std::string> next() = 0;
};

// An event as it is sent: `data` has no line breaks.
std::string event_text(const std::string& name, const std::string& data);

class HttpServer {
 public:
  // Null: there is no such thing. `query`: the value of "?at=...", empty where there is none.
  using Answer = std::function<std::shared_ptr<const std::string>(const std::string& query)>;
  using Follow = std::function<std::unique_ptr<EventStream>()>;

  // So many clients follow events at a time; others are told that it is full.
  static constexpr std::size_t kStreams = 16;

  // Takes the port, and answers nothing yet. Throws AddressError.
  explicit HttpServer(const ServerOptions& options);
  ~HttpServer();  // as stop()

  // Before start(). Called by several threads at a time.
  void page(const std::string& path, const std::string& type, Answer answer);
  void events(const std::string& path, Follow follow);

  void start();

  // Lets streams that are over come to their end, a second at most, then drops all clients.
  void stop();

  std::string url() const;  // "http://127.0.0.1:8417/"

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace hybrid_slam
