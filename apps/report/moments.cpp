#include "apps/report/moments.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "apps/report/jpeg_encoder.h"

namespace hybrid_slam {
namespace {

constexpr int kQuality = 70;
constexpr std::size_t kWorst = 12;  // moments with the fewest inliers
constexpr double kApart = 3;        // at least so many frame periods
constexpr std::size_t kLoops = 8;
constexpr std::size_t kOnTheWay = 8;

struct Wish {
  double time = 0;
  std::string why;
};

// The moments in the order of their importance.
std::vector<Wish> wishes(const RunStory& story, const ResultTable& loops) {
  std::vector<Wish> list;
  for (const LostStretch& loss : story.losses) {
    list.push_back({story.frames[loss.first].time, "lost: " + loss.cause});
  }
  std::size_t accepted = 0;
  for (std::size_t i = 0; i < loops.size() && accepted < kLoops; ++i) {
    if (loops.text(i, "outcome") != "accepted") continue;
    ++accepted;
    list.push_back({loops.number(i, "time"), "loop"});
    list.push_back({loops.number(i, "match_time"), "loop, seen before"});
  }
  for (const LostStretch& loss : story.losses) {
    if (loss.before) list.push_back({story.frames[*loss.before].time, "before lost"});
  }
  std::vector<const RunFrame*> weakest;
  for (const RunFrame& frame : story.frames) {
    const bool follows = frame.state == "map" || frame.state == "odometry";
    if (follows && frame.inliers > 0) weakest.push_back(&frame);
  }
  std::stable_sort(weakest.begin(), weakest.end(),
                   [](const RunFrame* a, const RunFrame* b) { return a->inliers < b->inliers; });
  std::vector<double> shown;  // of one weak moment one picture
  for (const RunFrame* frame : weakest) {
    const auto close = [&](double time) {
      return std::abs(time - frame->time) < kApart * story.period;
    };
    if (shown.size() >= kWorst || std::any_of(shown.begin(), shown.end(), close)) continue;
    shown.push_back(frame->time);
    list.push_back({frame->time, "fewest inliers"});
  }
  for (std::size_t i = 0; i < kOnTheWay && !story.frames.empty(); ++i) {
    list.push_back(
        {story.frames[i * (story.frames.size() - 1) / (kOnTheWay - 1)].time, "on the way"});
  }
  return list;
}

std::size_t nearest(const std::vector<double>& times, double time) {
  const auto after = std::lower_bound(times.begin(), times.end(), time);
  auto at = static_cast<std::size_t>(after - times.begin());
  if (at == times.size() || (at > 0 && time - times[at - 1] < times[at] - time)) --at;
  return at;
}

MomentPicture picture_of(const GrayImage& image, int width) {
  MomentPicture picture;
  picture.width = std::min(width, image.width);
  picture.height = std::max(1, image.height * picture.width / image.width);
  GrayImage small{picture.width, picture.height, {}};
  small.pixels.resize(static_cast<std::size_t>(picture.width * picture.height));
  const cv::Mat from(image.height, image.width, CV_8UC1,
                     const_cast<std::uint8_t*>(image.pixels.data()));  // which OpenCV reads
  cv::Mat to(picture.height, picture.width, CV_8UC1, small.pixels.data());
  cv::resize(from, to, to.size(), 0, 0, cv::INTER_AREA);
  picture.jpeg = encode_jpeg(small, kQuality);
  return picture;
}

}  // namespace

std::vector<MomentPicture> take_pictures(const RunStory& story, const ResultTable& loops,
                                         const ImageSequence& sequence,
                                         const PictureBudget& budget) {
  std::vector<MomentPicture> pictures;
  const std::vector<double>& times = sequence.info().times;
  const std::size_t reads =
      std::clamp<std::size_t>(story.frames.size() / (sequence.info().fisheye ? 40 : 20), 6, 40);
  std::vector<std::size_t> read;
  std::size_t bytes = 0;
  for (const Wish& wish : wishes(story, loops)) {
    if (read.size() >= reads || times.empty() || !std::isfinite(wish.time)) break;
    const std::size_t frame = nearest(times, wish.time);
    if (std::find(read.begin(), read.end(), frame) != read.end()) continue;
    read.push_back(frame);
    try {
      const FrameImages images = sequence.read(frame);
      for (const GrayImage* image : {&images.left, &images.fisheye}) {
        if (image->empty()) continue;
        MomentPicture picture = picture_of(*image, budget.width);
        bytes += picture.jpeg.size();
        if (bytes > budget.bytes) return pictures;
        picture.stereo = image == &images.left;
        picture.time = times[frame];
        picture.why = wish.why;
        pictures.push_back(std::move(picture));
      }
    } catch (const InputError&) {  // the image is damaged, which the run has said
    }
  }
  return pictures;
}

}  // namespace hybrid_slam
