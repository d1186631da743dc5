#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frontend/input/bags/topics.h"
#include "frontend/input/footage.h"
#include "frontend/input/image_sequence.h"

namespace CLI {
class App;
}

namespace hybrid_slam {

// What the user wants to be read: a dataset in a known layout, or own footage; and which frames.
struct InputChoice {
  std::string dataset;
  std::vector<std::string> more_bags;  // that follow the dataset, if it is one
  CameraTopics topics;                 // of bags
  SequenceLayout layout = SequenceLayout::kAuto;
  std::string sequence;
  SequenceCameras cameras = SequenceCameras::kAuto;
  TruthConvention truth_convention = TruthConvention::kAuto;
  InputOptions options;
  Footage footage;                      // `left` is empty where there is a dataset; its
                                        // calibration is that of bags, too
  std::optional<FootageImages> images;  // raw or rectified; none: to be found out
  std::size_t start = 0;                // first frame
  std::size_t every = 1;
  std::size_t limit = 0;  // frames, counted after `start` and `every`; 0: all
};

// Declares the options that say so, which all commands of the program share.
void add_input_options(CLI::App& app, InputChoice& input);

// Those of them that say how images become grey and belong together, and what they are.
void add_image_options(CLI::App& app, InputChoice& input);

// Throws CLI::ValidationError where they do not go together.
void check_input_choice(const InputChoice& input);

// Opens it, without a limit. Throws InputError.
std::unique_ptr<ImageSequence> open_input(const InputChoice& input);

}  // namespace hybrid_slam
