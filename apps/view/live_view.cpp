#include "apps/view/live_view.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "apps/report/page.h"
#include "apps/report/report_data.h"

namespace hybrid_slam {
namespace {

// The page before it is told anything.
std::string empty_page(const std::string& title) {
  ReportContent content;
  content.title = title;
  auto data = nlohmann::ordered_json::parse(report_data(content, 0));
  data["live"] = true;
  return report_page(title, data.dump(), PageOrigin::kServer);
}

}  // namespace

LiveView::~LiveView() { end(""); }

void LiveView::begin(LiveRun run) {
  const auto page = std::make_shared<const std::string>(empty_page(run.title));
  feed_ = std::make_unique<LiveFeed>(std::move(run));
  server_.page("/", "text/html; charset=utf-8", [page](const std::string&) { return page; });
  server_.events("/events", [this] { return feed_->watch(); });
  server_.start();
}

void LiveView::end(const std::string& text) {
  if (feed_ != nullptr) feed_->end(text);
  server_.stop();
}

}  // namespace hybrid_slam
