#include "apps/hybrid_slam/input_choice.h"

#include <CLI/CLI.hpp>
#include <map>
#include <utility>

#include "apps/dataset_check/footage_meaning.h"
#include "frontend/input/bags/bag_files.h"
#include "frontend/input/bags/bag_sequence.h"
#include "frontend/input/part_of_sequence.h"

namespace hybrid_slam {
namespace {

// Options of a dataset in a known layout.
void add_dataset_options(CLI::App& app, InputChoice& input) {
  const std::map<std::string, SequenceLayout> layouts{{"auto", SequenceLayout::kAuto},
                                                      {"kitti", SequenceLayout::kKitti},
                                                      {"euroc", SequenceLayout::kEuroc},
                                                      {"uwslam", SequenceLayout::kUwslam},
                                                      {"4seasons", SequenceLayout::kFourSeasons}};
  const std::map<std::string, SequenceCameras> cameras{{"auto", SequenceCameras::kAuto},
                                                       {"stereo", SequenceCameras::kStereo},
                                                       {"hybrid", SequenceCameras::kHybrid}};
  const std::map<std::string, TruthConvention> conventions{
      {"auto", TruthConvention::kAuto},
      {"world_from_cam", TruthConvention::kWorldFromCam},
      {"cam_from_world", TruthConvention::kCamFromWorld}};
  app.add_option_function<std::vector<std::string>>(
      "DATASET",
      [&input](const std::vector<std::string>& paths) {
        input.dataset = paths.front();
        input.more_bags.assign(paths.begin() + 1, paths.end());
      },
      "folder of the dataset; or bags that follow one another");
  app.add_option("--layout", input.layout, "auto, kitti, euroc, uwslam or 4seasons")
      ->transform(CLI::CheckedTransformer(layouts).description(""))
      ->option_text("NAME");
  app.add_option("--sequence", input.sequence,
                 "sequence of the dataset; the only one if not given");
  app.add_option("--cameras", input.cameras,
                 "stereo, hybrid (with the fisheye) or auto (default: with the fisheye, if the "
                 "dataset has one)")
      ->transform(CLI::CheckedTransformer(cameras).description(""))
      ->option_text("WHICH");
  app.add_option("--gt-convention", input.truth_convention,
                 "how the true poses of a UWslam sequence are meant; auto (default) finds out")
      ->transform(CLI::CheckedTransformer(conventions).description(""))
      ->option_text("auto|world_from_cam|cam_from_world");
}

void add_bag_options(CLI::App& app, CameraTopics& topics) {
  const auto add = [&](const char* option, std::string& topic, const char* camera) {
    app.add_option(option, topic,
                   std::string("bags: topic of the ") + camera +
                       " images (default: found by type and name)")
        ->option_text("TOPIC");
  };
  add("--left-topic", topics.left, "left");
  add("--right-topic", topics.right, "right");
  add("--fisheye-topic", topics.fisheye, "fisheye's");
}

bool is_bags(const InputChoice& input) {
  return input.layout == SequenceLayout::kAuto && !input.dataset.empty() && is_bag(input.dataset);
}

std::unique_ptr<ImageSequence> open_dataset(const InputChoice& input) {
  if (is_bags(input)) {
    std::vector<std::string> paths{input.dataset};
    paths.insert(paths.end(), input.more_bags.begin(), input.more_bags.end());
    return open_bags(paths, input.cameras, {input.topics, input.footage.calibration},
                     input.options);
  }
  return open_sequence(input.dataset, input.layout, input.sequence, input.cameras,
                       input.truth_convention, input.options);
}

// Options of images that lie in no known layout.
void add_footage_options(CLI::App& app, InputChoice& input) {
  Footage& footage = input.footage;
  app.add_option("--left", footage.left,
                 "instead of DATASET: left images: a folder, a quoted pattern or a video")
      ->option_text("DIR|PATTERN|VIDEO");
  app.add_option("--right", footage.right, "likewise, right images")
      ->option_text("DIR|PATTERN|VIDEO");
  app.add_option("--fisheye", footage.fisheye, "likewise, images of the fisheye")
      ->option_text("DIR|PATTERN|VIDEO");
  app.add_option("--calibration", footage.calibration,
                 "of the pair (one file, or left and right), then of the fisheye; bags: instead of "
                 "their CameraInfo")
      ->option_text("FILE...");
  app.add_option("--times", footage.times,
                 "file with the frames' times (default: by the images' names)")
      ->option_text("FILE");
  app.add_option("--fps", footage.rate, "images per second, where nothing else tells their times")
      ->check(CLI::Range(1e-3, 1e5).description(""))
      ->option_text("HZ");
}

void add_frame_options(CLI::App& app, InputChoice& input) {
  app.add_option("--start", input.start, "first frame, counted from 0")
      ->check(CLI::NonNegativeNumber.description(""))
      ->option_text("FRAME");
  app.add_option("--every", input.every, "only every so many frames")
      ->check(CLI::PositiveNumber.description(""))
      ->option_text("N");
  app.add_option("--limit", input.limit, "process so many frames at most")
      ->check(CLI::PositiveNumber.description(""));
}

}  // namespace

void add_image_options(CLI::App& app, InputChoice& input) {
  InputOptions& options = input.options;
  const std::map<std::string, FootageImages> meanings{{"raw", FootageImages::kRaw},
                                                      {"rectified", FootageImages::kRectified}};
  const std::map<std::string, GrayChannel> channels{{"grey", GrayChannel::kGrey},
                                                    {"red", GrayChannel::kRed},
                                                    {"green", GrayChannel::kGreen},
                                                    {"blue", GrayChannel::kBlue}};
  app.add_option("--channel", options.images.channel,
                 "of colour images: grey (default: all three weighed), red, green or blue")
      ->transform(CLI::CheckedTransformer(channels).description(""))
      ->option_text("NAME");
  app.add_option("--white-level", options.images.white,
                 "sample that is white in images of more than 8 bits (default: found)")
      ->check(CLI::Range(255, 65535).description(""));
  app.add_option(
         "--pair-tolerance", options.pair_tolerance,
         "seconds that the times of left and right may differ (default: a tenth of the frame "
         "period, at most 0.01)")
      ->check(CLI::Range(1e-6, 10.0).description(""));
  app.add_option("--images", input.images,
                 "raw or rectified (default: what the calibration allows, and the rows tell)")
      ->transform(CLI::CheckedTransformer(meanings).description(""))
      ->option_text("raw|rectified");
}

void add_input_options(CLI::App& app, InputChoice& input) {
  add_dataset_options(app, input);
  add_bag_options(app, input.topics);
  add_footage_options(app, input);
  add_image_options(app, input);
  add_frame_options(app, input);
}

void check_input_choice(const InputChoice& input) {
  if (!input.more_bags.empty() && !is_bags(input)) {
    throw CLI::ValidationError(input.more_bags.front() + ": only bags can follow one another");
  }
  const Footage& footage = input.footage;
  const bool own = !footage.left.empty() || !footage.right.empty();
  if (!own) {
    if (!footage.fisheye.empty() || (!footage.calibration.empty() && !is_bags(input)) ||
        !footage.times.empty() || footage.rate > 0 || input.images) {
      throw CLI::ValidationError(
          "--fisheye, --calibration, --times, --fps and --images need --left and --right");
    }
    if (input.dataset.empty()) {
      throw CLI::ValidationError("DATASET is required, or --left, --right and --calibration");
    }
    return;
  }
  if (!input.dataset.empty()) {
    throw CLI::ValidationError("DATASET and --left or --right: one or the other");
  }
  if (input.layout != SequenceLayout::kAuto || !input.sequence.empty() ||
      input.cameras != SequenceCameras::kAuto || input.truth_convention != TruthConvention::kAuto) {
    throw CLI::ValidationError(
        "--layout, --sequence, --cameras and --gt-convention need a DATASET");
  }
  if (footage.left.empty()) throw CLI::ValidationError("--right needs --left");
  if (footage.right.empty()) throw CLI::ValidationError("--left needs --right");
  if (footage.calibration.empty()) throw CLI::ValidationError("--left needs --calibration");
  if (!footage.times.empty() && footage.rate > 0) {
    throw CLI::ValidationError("--times and --fps: one or the other");
  }
}

std::unique_ptr<ImageSequence> open_input(const InputChoice& input) {
  auto sequence = input.footage.left.empty()
                      ? open_dataset(input)
                      : open_footage_as_it_is(input.footage, input.images, input.options);
  return part_of_sequence(std::move(sequence), input.start, input.every);
}

}  // namespace hybrid_slam
