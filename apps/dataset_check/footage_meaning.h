#pragma once

#include <memory>
#include <optional>
#include <string>

#include "frontend/input/footage.h"

namespace hybrid_slam {

// Opens own footage. Where nobody says whether its images are raw or rectified, the calibration
// does, if it allows one only; else the rows of matches in a few pairs: those of a rectified pair
// agree. What was found is a line in SequenceInfo::warnings. Throws InputError as open_footage().
std::unique_ptr<ImageSequence> open_footage_as_it_is(const Footage& footage,
                                                     std::optional<FootageImages> images,
                                                     const InputOptions& options);

// Whether the rows of a few pairs agree better as raw images, which `raw` rectifies, than as the
// rectified ones that `rectified` takes them for; `note` says what was found.
bool rows_say_raw(const ImageSequence& raw, const ImageSequence& rectified, std::string& note);

}  // namespace hybrid_slam
