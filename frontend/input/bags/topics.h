#pragma once

#include <string>
#include <vector>

#include "frontend/input/bags/bag.h"

namespace hybrid_slam {

// Topics of the cameras' images; an empty one is not given, or there is none.
struct CameraTopics {
  std::string left;
  std::string right;
  std::string fisheye;
};

// Which topics hold the images. What `wanted` names must be there; the rest is found among the
// image topics by name: left and right, then numbers that follow each other (cam0 and cam1, infra1
// and infra2), rectified before raw, uncompressed before compressed; the fisheye by "fish" or
// "wrist". Throws InputError, beginning with `source`, that tells the topics there are, if one is
// missing or several are as good as each other.
CameraTopics choose_topics(const std::vector<BagTopic>& topics, const CameraTopics& wanted,
                           bool with_fisheye, const std::string& source);

// Whether a topic's name says that its images are rectified.
bool is_rectified_topic(const std::string& topic);

// Where the CameraInfo of an image topic is published: /left/camera_info of /left/image_raw and of
// /left/image_raw/compressed.
std::string camera_info_topic(const std::string& topic);

}  // namespace hybrid_slam
