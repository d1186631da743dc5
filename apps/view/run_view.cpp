#include "apps/view/run_view.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "apps/report/report.h"
#include "apps/slam/one_at_a_time.h"
#include "apps/view/live_picture.h"
#include "backend/map/map_file.h"
#include "cameras/files/input_error.h"

namespace hybrid_slam {
namespace {

using Text = std::shared_ptr<const std::string>;

constexpr double kSameTime = 1e-4;  // [s]

// "0:12.5", the left camera at 12.5 s; "1:...", the fisheye.
struct Asked {
  bool stereo = true;
  double time = 0;
};

std::optional<Asked> asked_for(const std::string& query) {
  const bool has_camera = query.starts_with("0:") || query.starts_with("1:");
  if (!has_camera) return std::nullopt;
  try {
    std::size_t end = 0;
    const double time = std::stod(query.substr(2), &end);
    if (end + 2 != query.size() || !std::isfinite(time)) return std::nullopt;
    return Asked{query[0] == '0', time};
  } catch (const std::exception&) {  // no number
    return std::nullopt;
  }
}

}  // namespace

class RunView::Work {
 public:
  Work(const std::filesystem::path& folder, const ServerOptions& options)
      : server_(options), page_(std::make_shared<const std::string>(served_report(folder))) {
    if (auto sequence = dataset_of(folder)) images_.emplace(std::move(sequence));
    if (std::filesystem::exists(folder / "map.hslam")) map_ = load_map(folder / "map.hslam");
    server_.page("/", "text/html; charset=utf-8", [this](const std::string&) { return page_; });
    server_.page("/picture", "application/json",
                 [this](const std::string& query) { return picture(query); });
  }

  HttpServer& server() { return server_; }

 private:
  static Text no_picture() { return std::make_shared<const std::string>("null"); }

  // Null where what is asked for is no camera and time.
  Text picture(const std::string& query) const {
    const auto asked = asked_for(query);
    if (!asked) return nullptr;
    const std::vector<double> times = images_ ? images_->info().times : std::vector<double>();
    for (std::size_t i = 0; i < times.size(); ++i) {
      if (std::abs(times[i] - asked->time) < kSameTime) return picture(i, asked->stereo);
    }
    return no_picture();
  }

  Text picture(std::size_t index, bool stereo) const {
    FrameImages images;
    try {
      images = images_->read(index);
    } catch (const InputError&) {
      return no_picture();
    }
    const GrayImage& image = stereo ? images.left : images.fisheye;
    if (image.empty()) return no_picture();
    const auto json = keyframe_picture_json(stereo ? CameraKind::kStereo : CameraKind::kFisheye,
                                            images_->info().times[index], small_image(image),
                                            map_ ? &map_->map.view() : nullptr);
    return std::make_shared<const std::string>(json.dump());
  }

  HttpServer server_;
  Text page_;
  std::optional<OneAtATime> images_;
  std::optional<LoadedMap> map_;
};

RunView::RunView(const std::filesystem::path& folder, const ServerOptions& options)
    : work_(std::make_unique<Work>(folder, options)) {}
RunView::~RunView() = default;

void RunView::start() { work_->server().start(); }
std::string RunView::url() const { return work_->server().url(); }

}  // namespace hybrid_slam
