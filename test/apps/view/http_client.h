#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <utility>

namespace hybrid_slam {

// A connection to a server on this machine, as plain as it goes: what is tested shares no code with
// the server.
class HttpClient {
 public:
  // Closed where nobody listens there.
  explicit HttpClient(int port, const std::string& address = "127.0.0.1", int receive_buffer = 0);
  ~HttpClient();
  HttpClient(const HttpClient&) = delete;
  HttpClient& operator=(const HttpClient&) = delete;

  bool connected() const { return socket_ >= 0; }

  // Sends "GET path". `host`: what the request says that the server is called.
  void get(const std::string& path, const std::string& host = "localhost",
           const std::string& method = "GET");

  // Status and body of the answer; the status is 0 if there is none within the time.
  std::pair<int, std::string> answer(std::chrono::seconds limit = std::chrono::seconds(20));

  // The next server-sent event, its name and its data. None once the stream is over, or after the
  // time.
  std::optional<std::pair<std::string, std::string>> event(
      std::chrono::seconds limit = std::chrono::seconds(20));

 private:
  bool receive(std::chrono::steady_clock::time_point end);  // more; false: no more
  bool receive_header(std::chrono::steady_clock::time_point end);
  void take_chunks();

  int socket_ = -1;
  bool has_header_ = false;
  bool chunked_ = false;
  int status_ = 0;
  std::string raw_;   // as it came
  std::string body_;  // without the chunks' sizes
};

// A port that nobody uses.
int free_port();

}  // namespace hybrid_slam
