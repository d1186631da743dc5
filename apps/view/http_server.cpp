// The one source that reads httplib.h, which is large.
#include "apps/view/http_server.h"

#include <fmt/format.h>
#include <httplib.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <optional>
#include <utility>

#include "apps/slam/background.h"

namespace hybrid_slam {
namespace {

using httplib::Request;
using httplib::Response;

// Threads for short answers, beside one for each stream.
constexpr std::size_t kAnswerThreads = 8;

// A client that takes nothing for so long, while all buffers are full, is dropped. Browsers come
// again by themselves and get the present state.
constexpr int kStalledSeconds = 2;

bool is_loopback(const std::string& address) {
  return address.starts_with("127.") || address == "::1" || address == "localhost";
}

// "localhost:8417" without the port.
std::string host_of(const Request& request) {
  const std::string host = request.get_header_value("Host");
  if (host.starts_with('[')) return host.substr(0, host.find(']') + 1);
  return host.substr(0, host.find(':'));
}

std::string why_not(const ServerOptions& options, int error) {
  switch (error) {
    case EADDRINUSE:
      return fmt::format("port {} is in use", options.port);
    case EACCES:
      return fmt::format("port {} is for privileged users only", options.port);
    case EADDRNOTAVAIL:
      return options.address + " is no address of this machine";
    default:
      return fmt::format("{}, port {}: cannot be listened on", options.address, options.port);
  }
}

}  // namespace

std::string event_text(const std::string& name, const std::string& data) {
  return "event: " + name + "\ndata: " + data + "\n\n";
}

class HttpServer::Work {
 public:
  explicit Work(const ServerOptions& options) : options_(options) {
    server_.new_task_queue = [] { return new httplib::ThreadPool(kStreams + kAnswerThreads); };
    // httplib's own would set SO_REUSEPORT, too, by which two servers share a port unawares.
    server_.set_socket_options([](socket_t socket) {
      const int yes = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    });
    server_.set_tcp_nodelay(true);
    server_.set_keep_alive_timeout(1);  // an idle connection holds a thread
    server_.set_read_timeout(kStalledSeconds);
    server_.set_write_timeout(kStalledSeconds);
    server_.set_default_headers({{"Cache-Control", "no-store"},
                                 {"Cross-Origin-Resource-Policy", "same-origin"},
                                 {"X-Content-Type-Options", "nosniff"}});
    server_.set_pre_routing_handler([this](const Request& request, Response& response) {
      if (is_for_us(request)) return Server::HandlerResponse::Unhandled;
      response.status = 403;
      response.set_content("not the name of this machine\n", "text/plain");
      return Server::HandlerResponse::Handled;
    });
    bind();
  }

  ~Work() { stop(); }

  void page(const std::string& path, const std::string& type, Answer answer) {
    server_.Get(
        path, [type, answer = std::move(answer)](const Request& request, Response& response) {
          const auto content = answer(request.get_param_value("at"));
          if (content == nullptr) {
            response.status = 404;
            return;
          }
          // By a provider: it is not copied, nor compressed, which would take longer than a
          // network.
          response.set_content_provider(content->size(), type,
                                        [content](std::size_t from, std::size_t size, auto& sink) {
                                          return sink.write(content->data() + from, size);
                                        });
        });
  }

  void events(const std::string& path, Follow follow) {
    server_.Get(path, [this, follow = std::move(follow)](const Request&, Response& response) {
      if (++streams_ > kStreams) {
        --streams_;
        response.status = 503;
        response.set_content("too many are watching\n", "text/plain");
        return;
      }
      const std::shared_ptr<EventStream> stream = follow();
      response.set_chunked_content_provider(
          "text/event-stream",
          [stream](std::size_t, httplib::DataSink& sink) {
            const auto text = stream->next();
            if (text == nullptr) {
              sink.done();
              return true;
            }
            if (text->empty()) return sink.write(":\n\n", 3);  // a comment: we are still here
            return sink.write(text->data(), text->size());
          },
          [this](bool) { --streams_; });
    });
  }

  void start() {
    thread_.emplace("view server", [this] {
      server_.listen_after_bind();
      ended_ = true;
    });
    while (!server_.is_running() && !ended_) usleep(1000);
    if (ended_) throw AddressError(why_not(options_, 0));
  }

  void stop() {
    if (!thread_) return;
    for (int i = 0; i < 100 && streams_ > 0; ++i) usleep(10'000);
    server_.stop();
    thread_.reset();
  }

  std::string url() const {
    const bool v6 = options_.address.find(':') != std::string::npos;
    const std::string host = v6 ? '[' + options_.address + ']' : options_.address;
    return fmt::format("http://{}:{}/", host, port_);
  }

 private:
  using Server = httplib::Server;

  void bind() {
    errno = 0;
    if (options_.port == 0) {
      port_ = server_.bind_to_any_port(options_.address);
    } else {
      port_ = server_.bind_to_port(options_.address, options_.port) ? options_.port : -1;
    }
    if (port_ < 0) throw AddressError(why_not(options_, errno));
  }

  // A page of somebody else, whose name was made to point here, would be let in by the browser: of
  // what only this machine can reach, names that mean something else are refused.
  bool is_for_us(const Request& request) const {
    if (!is_loopback(options_.address)) return true;
    const std::string host = host_of(request);
    return host == "localhost" || host == "[::1]" || host == options_.address ||
           (host.starts_with("127.") && host.find_first_not_of("0123456789.") == std::string::npos);
  }

  const ServerOptions options_;
  Server server_;
  int port_ = -1;
  std::atomic<std::size_t> streams_ = 0;
  std::atomic<bool> ended_ = false;  // it listens no more
  std::optional<Background> thread_;
};

HttpServer::HttpServer(const ServerOptions& options) : work_(std::make_unique<Work>(options)) {}
HttpServer::~HttpServer() = default;

void HttpServer::page(const std::string& path, const std::string& type, Answer answer) {
  work_->page(path, type, std::move(answer));
}

void HttpServer::events(const std::string& path, Follow follow) {
  work_->events(path, std::move(follow));
}

void HttpServer::start() { work_->start(); }
void HttpServer::stop() { work_->stop(); }
std::string HttpServer::url() const { return work_->url(); }

}  // namespace hybrid_slam
