#include "apps/slam/live/live_cameras.h"

#include <fmt/format.h>

#include <utility>

#include "apps/dataset_check/footage_meaning.h"
#include "frontend/input/stamp_offset.h"

namespace hybrid_slam {
namespace {

ImageSize size_of(const StampedImage& image) { return {image.image.width, image.image.height}; }

// The first sets as a sequence, raw ones with a rectifier.
class FirstSets final : public ImageSequence {
 public:
  FirstSets(SequenceInfo info, const std::vector<ImageSet>& sets, const StereoRectifier* rectifier)
      : info_(std::move(info)), sets_(sets), rectifier_(rectifier) {
    for (const ImageSet& set : sets) info_.times.push_back(seconds_of_stamp(set.left.stamp));
  }
  const SequenceInfo& info() const override { return info_; }
  FrameImages read(std::size_t frame) const override {
    const ImageSet& set = sets_.at(frame);
    FrameImages images;
    images.left = set.left.image;
    images.right = set.right.image;
    if (rectifier_ != nullptr) {
      rectifier_->rectify_left(images.left);
      rectifier_->rectify_right(images.right);
    }
    return images;
  }

 private:
  SequenceInfo info_;
  const std::vector<ImageSet>& sets_;
  const StereoRectifier* rectifier_;
};

class Settling {
 public:
  Settling(SetSource& source, const Footage& footage, const std::stop_token& stop)
      : source_(source), footage_(footage), stop_(stop) {
    cameras_.info.name = footage.left.front();
    cameras_.info.layout = "live";
  }

  // Until there is a set that is whole, the fisheye's image included. What comes before stays.
  bool find_sizes() {
    constexpr std::size_t kPatience = 20;  // sets that lack something
    while (cameras_.first.size() < kPatience) {
      if (!take()) return false;
      const ImageSet& set = cameras_.first.back();
      if (!set.error.empty() || (!footage_.fisheye.empty() && !set.fisheye)) continue;
      cameras_.sizes = {size_of(set.left), size_of(set.right), {}};
      if (set.fisheye) cameras_.sizes.fisheye = size_of(*set.fisheye);
      return true;
    }
    const ImageSet& set = cameras_.first.back();
    throw InputError(set.error.empty() ? footage_.fisheye.front() +
                                             ": no fisheye image belongs to any of the first pairs"
                                       : set.error);
  }

  FootageImages find_meaning() {
    const FootageMeanings meanings = footage_meanings(footage_, cameras_.sizes.left);
    if (!meanings.raw) return FootageImages::kRectified;
    if (!meanings.rectified) return FootageImages::kRaw;
    constexpr std::size_t kPairs = 5;
    std::vector<ImageSet> pairs{cameras_.first.back()};
    while (pairs.size() < kPairs && take()) {
      const ImageSet& set = cameras_.first.back();
      if (set.error.empty() && cameras_.complaint(set).empty()) pairs.push_back(set);
    }
    SequenceInfo raw_info = cameras_.info, rectified_info = cameras_.info;
    const auto rectifier =
        read_footage_cameras(footage_, FootageImages::kRaw, cameras_.sizes, raw_info);
    read_footage_cameras(footage_, FootageImages::kRectified, cameras_.sizes, rectified_info);
    const FirstSets raw(raw_info, pairs, rectifier.get());
    const FirstSets rectified(rectified_info, pairs, nullptr);
    std::string note;
    const bool is_raw = rows_say_raw(raw, rectified, note);
    cameras_.info.warnings.push_back(std::move(note));
    return is_raw ? FootageImages::kRaw : FootageImages::kRectified;
  }

  LiveCameras settle(FootageImages images) {
    cameras_.images = images;
    cameras_.rectifier = read_footage_cameras(footage_, images, cameras_.sizes, cameras_.info);
    for (std::string& doubt : doubts_of_units(cameras_.info)) {
      cameras_.info.warnings.push_back(std::move(doubt));
    }
    return std::move(cameras_);
  }

 private:
  bool take() {
    auto set = source_.next(stop_);
    if (set) cameras_.first.push_back(std::move(*set));
    return set.has_value();
  }

  SetSource& source_;
  const Footage& footage_;
  const std::stop_token& stop_;
  LiveCameras cameras_;
};

std::string size_complaint(const char* camera, ImageSize image, ImageSize expected) {
  if (image == expected) return {};
  return fmt::format("the {} image is {}x{}, those before were {}x{}", camera, image.width,
                     image.height, expected.width, expected.height);
}

}  // namespace

std::string LiveCameras::complaint(const ImageSet& set) const {
  if (!set.error.empty()) return set.error;
  std::string complaint = size_complaint("left", size_of(set.left), sizes.left);
  if (complaint.empty()) complaint = size_complaint("right", size_of(set.right), *sizes.right);
  if (complaint.empty() && set.fisheye) {
    complaint = size_complaint("fisheye", size_of(*set.fisheye), sizes.fisheye);
  }
  return complaint;
}

std::optional<LiveCameras> settle_cameras(SetSource& source, const Footage& footage,
                                          std::optional<FootageImages> images,
                                          const std::stop_token& stop) {
  Settling settling(source, footage, stop);
  if (!settling.find_sizes()) return std::nullopt;
  return settling.settle(images ? *images : settling.find_meaning());
}

}  // namespace hybrid_slam
