#pragma once

#include <string>

#include "apps/view/http_server.h"
#include "apps/view/live_feed.h"

namespace hybrid_slam {

// A run that can be watched in a browser while it goes on: the page of the report, which is fed by
// the run. docs/view.md.
class LiveView {
 public:
  // Takes the port. Throws AddressError.
  explicit LiveView(const ServerOptions& options) : server_(options) {}
  ~LiveView();  // as end()

  // Serves from here on.
  void begin(LiveRun run);

  // After begin(): whom the run tells.
  LiveFeed& feed() { return *feed_; }

  // The run is over, and what it left. Watchers are told; then nothing is served any more.
  void end(const std::string& text);

  std::string url() const { return server_.url(); }

 private:
  std::unique_ptr<LiveFeed> feed_;
  HttpServer server_;
};

}  // namespace hybrid_slam
