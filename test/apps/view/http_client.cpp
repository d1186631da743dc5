#include "test/apps/view/http_client.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <stdexcept>

namespace hybrid_slam {
namespace {

using Clock = std::chrono::steady_clock;

sockaddr_in place(const std::string& address, int port) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(port));
  inet_pton(AF_INET, address.c_str(), &to.sin_addr);
  return to;
}

}  // namespace

HttpClient::HttpClient(int port, const std::string& address, int receive_buffer) {
  socket_ = socket(AF_INET, SOCK_STREAM, 0);
  if (receive_buffer > 0) {
    setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof(receive_buffer));
  }
  const sockaddr_in to = place(address, port);
  if (connect(socket_, reinterpret_cast<const sockaddr*>(&to), sizeof(to)) == 0) return;
  close(socket_);
  socket_ = -1;
}

HttpClient::~HttpClient() {
  if (socket_ >= 0) close(socket_);
}

void HttpClient::get(const std::string& path, const std::string& host, const std::string& method) {
  const std::string request =
      method + ' ' + path + " HTTP/1.1\r\nHost: " + host + "\r\nConnection: close\r\n\r\n";
  if (send(socket_, request.data(), request.size(), MSG_NOSIGNAL) < 0) socket_ = -1;
}

bool HttpClient::receive(Clock::time_point end) {
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now());
  pollfd wait{socket_, POLLIN, 0};
  if (socket_ < 0 || left.count() <= 0 || poll(&wait, 1, static_cast<int>(left.count())) <= 0) {
    return false;
  }
  char buffer[65536];
  const ssize_t size = recv(socket_, buffer, sizeof(buffer), 0);
  if (size <= 0) return false;
  raw_.append(buffer, static_cast<std::size_t>(size));
  return true;
}

bool HttpClient::receive_header(Clock::time_point end) {
  while (!has_header_) {
    const std::size_t at = raw_.find("\r\n\r\n");
    if (at == std::string::npos) {
      if (!receive(end)) return false;
      continue;
    }
    const std::string header = raw_.substr(0, at);
    raw_.erase(0, at + 4);
    has_header_ = true;
    status_ = std::stoi(header.substr(9, 3));
    chunked_ = header.find("Transfer-Encoding: chunked") != std::string::npos;
  }
  return true;
}

void HttpClient::take_chunks() {
  if (!chunked_) {
    body_ += std::exchange(raw_, "");
    return;
  }
  while (true) {
    const std::size_t end = raw_.find("\r\n");
    if (end == std::string::npos) return;
    const std::size_t size = std::stoul(raw_.substr(0, end), nullptr, 16);
    if (raw_.size() < end + 2 + size + 2) return;
    body_ += raw_.substr(end + 2, size);
    raw_.erase(0, end + 2 + size + 2);
    if (size == 0) return;
  }
}

std::pair<int, std::string> HttpClient::answer(std::chrono::seconds limit) {
  const auto end = Clock::now() + limit;
  if (!receive_header(end)) return {0, ""};
  while (receive(end)) {  // the server closes connections that ask for nothing more
  }
  take_chunks();
  return {status_, body_};
}

std::optional<std::pair<std::string, std::string>> HttpClient::event(std::chrono::seconds limit) {
  const auto end = Clock::now() + limit;
  if (!receive_header(end)) return std::nullopt;
  while (true) {
    take_chunks();
    const std::size_t at = body_.find("\n\n");
    if (at == std::string::npos) {
      if (!receive(end)) return std::nullopt;
      continue;
    }
    const std::string block = body_.substr(0, at);
    body_.erase(0, at + 2);
    const std::size_t name = block.find("event: "), data = block.find("\ndata: ");
    if (name == std::string::npos || data == std::string::npos) continue;  // a comment
    return std::pair(block.substr(name + 7, data - name - 7), block.substr(data + 7));
  }
}

int free_port() {
  const int probe = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in at = place("127.0.0.1", 0);
  socklen_t size = sizeof(at);
  if (bind(probe, reinterpret_cast<const sockaddr*>(&at), size) != 0 ||
      getsockname(probe, reinterpret_cast<sockaddr*>(&at), &size) != 0) {
    throw std::runtime_error("no free port");
  }
  close(probe);
  return ntohs(at.sin_port);
}

}  // namespace hybrid_slam
