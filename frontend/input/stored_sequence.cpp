#include "frontend/input/stored_sequence.h"

#include <algorithm>
#include <cstdio>
#include <numeric>

#include "frontend/input/file_sequence.h"

namespace hybrid_slam {

namespace {

// Up to `count` frames, evenly from all over the sequence.
std::vector<std::size_t> sample_frames(std::size_t size, std::size_t count) {
  std::vector<std::size_t> frames;
  for (std::size_t i = 0; i < std::min(size, count); ++i) {
    frames.push_back(i * size / std::min(size, count));
  }
  return frames;
}

// The highest sample of the images that can be read; 0 where they have 8 bits.
int highest_sample(const ImageStore& store) {
  constexpr std::size_t kFrames = 8;
  int highest = 0;
  for (const std::size_t frame : sample_frames(store.size(), kFrames)) {
    for (const SequenceCamera camera :
         {SequenceCamera::kLeft, SequenceCamera::kRight, SequenceCamera::kFisheye}) {
      if (!store.has(frame, camera)) continue;
      try {
        const DecodedImage image = store.decode(frame, camera, std::nullopt, GrayChannel::kGrey);
        highest = std::max(highest, highest_sample(image));
      } catch (const InputError&) {  // counted when the frame is read
      }
    }
    if (highest == 0 && store.has(frame, SequenceCamera::kLeft)) return 0;
  }
  return highest;
}

// Mean brightness of a few left images that can be read; none if there are none.
std::optional<double> mean_brightness(const ImageStore& store, const ImageReading& reading) {
  constexpr std::size_t kFrames = 3;
  double sum = 0;
  double count = 0;
  for (const std::size_t frame : sample_frames(store.size(), kFrames)) {
    if (!store.has(frame, SequenceCamera::kLeft)) continue;
    try {
      const GrayImage image = to_gray(
          store.decode(frame, SequenceCamera::kLeft, std::nullopt, reading.channel), reading);
      sum = std::accumulate(image.pixels.begin(), image.pixels.end(), sum);
      count += static_cast<double>(image.pixels.size());
    } catch (const InputError&) {  // counted when the frame is read
    }
  }
  return count > 0 ? std::optional(sum / count) : std::nullopt;
}

const char* name_of(SequenceCamera camera) {
  return camera == SequenceCamera::kLeft    ? "left"
         : camera == SequenceCamera::kRight ? "right"
                                            : "fisheye";
}

}  // namespace

StoredSequence::StoredSequence(SequenceInfo info, std::unique_ptr<const ImageStore> store,
                               const InputOptions& options,
                               std::unique_ptr<const StereoRectifier> rectifier)
    : info_(std::move(info)),
      store_(std::move(store)),
      options_(options),
      rectifier_(std::move(rectifier)) {
  if (store_->size() != info_.times.size()) throw std::logic_error("one time per frame");
  if (options_.images.white == 0) find_white();
  warn_of_darkness();
  for (std::string& doubt : doubts_of_units(info_)) info_.warnings.push_back(std::move(doubt));
}

// 16 bits are what they say; fewer are found by what the images hold.
void StoredSequence::find_white() {
  constexpr int kAllBits = 65535;
  const int highest = highest_sample(*store_);
  if (highest == 0) return;
  options_.images.white = white_above(highest);
  if (options_.images.white == kAllBits) return;
  info_.warnings.push_back(info_.name + ": the images have more than 8 bits, with samples up to " +
                           std::to_string(highest) + "; " + std::to_string(options_.images.white) +
                           " is taken for white (--white-level settles it)");
}

void StoredSequence::warn_of_darkness() {
  constexpr double kDark = 8;  // of 255: noise and rounding are a good part of so small a contrast
  const auto mean = mean_brightness(*store_, options_.images);
  if (!mean || *mean >= kDark) return;
  char text[16];
  std::snprintf(text, sizeof(text), "%.1f", *mean);
  info_.warnings.push_back(
      info_.name + ": the left images are " +
      (*mean == 0 ? "black"
                  : "dark: mean brightness " + std::string(text) + " of 255 in those looked at"));
}

GrayImage StoredSequence::read_image(std::size_t frame, SequenceCamera camera,
                                     ImageSize size) const {
  if (!store_->has(frame, camera)) {
    throw InputError(info_.name + ": frame " + std::to_string(frame) + ": no " + name_of(camera) +
                     " image");
  }
  return to_gray(store_->decode(frame, camera, size, options_.images.channel), options_.images);
}

FrameImages StoredSequence::read(std::size_t frame) const {
  const ImageSize size{info_.stereo.width, info_.stereo.height};
  FrameImages images;
  images.frame_index = static_cast<std::int64_t>(frame);
  images.time = info_.times.at(frame);
  images.left = read_image(frame, SequenceCamera::kLeft, size);
  images.right =
      read_image(frame, SequenceCamera::kRight, rectifier_ ? rectifier_->right_size() : size);
  if (rectifier_) {
    rectifier_->rectify_left(images.left);
    rectifier_->rectify_right(images.right);
  }
  if (info_.fisheye) {
    try {
      images.fisheye = read_image(frame, SequenceCamera::kFisheye,
                                  {info_.fisheye->width, info_.fisheye->height});
    } catch (const InputError& error) {
      images.fisheye_error = error.what();
    }
  }
  return images;
}

}  // namespace hybrid_slam
