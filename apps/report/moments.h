#pragma once

#include <string>
#include <vector>

#include "apps/report/result_table.h"
#include "apps/report/run_story.h"
#include "frontend/input/image_sequence.h"

namespace hybrid_slam {

// A small picture of what a camera saw.
struct MomentPicture {
  bool stereo = true;  // the left camera's, else the fisheye's
  double time = 0;     // [s]
  std::string why;     // "lost", "before lost", "loop", "fewest inliers", "on the way"
  int width = 0;
  int height = 0;
  std::string jpeg;
};

struct PictureBudget {
  std::size_t bytes = 700'000;  // of all JPEG files
  int width = 320;              // of each [px]
};

// Pictures of the moments that matter: losses first, then loops, what was seen before the losses,
// the fewest inliers, and some on the way. Images are read from the sequence once more, of one in
// twenty moments (six at least, forty at most): reading and rectifying a pair takes up to a seventh
// of what a run does with a frame, so this is below one per cent of it. Images that cannot be read
// are left out.
std::vector<MomentPicture> take_pictures(const RunStory& story, const ResultTable& loops,
                                         const ImageSequence& sequence,
                                         const PictureBudget& budget = {});

}  // namespace hybrid_slam
