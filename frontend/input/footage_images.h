#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace hybrid_slam {

// What the names of images tell of their order.
enum class NameOrder {
  kStamps,   // times: 1403636579763555584.png, 1403636579.763556.png, 1403636579_763556.png
  kNumbers,  // one number that changes: left_000012.png
  kNames     // several numbers change: the order of the names
};

struct FootageImage {
  std::filesystem::path path;
  std::int64_t key = 0;  // time [ns], number, or place
};

// Images of one camera, ascending by key.
struct FootageList {
  NameOrder order = NameOrder::kNumbers;
  std::vector<FootageImage> images;
  std::string note;  // where times in names are not in nanoseconds; else empty
};

// The image files that `source` names, as below, by their names. None yet: empty. Throws InputError
// for what is no folder, file or pattern.
std::vector<std::filesystem::path> footage_files(const std::vector<std::string>& source);

// The images that `source` names: a folder (all images in it), a pattern with * and ?, or files.
// Numbers of 19 digits, 16 (from 10^15 on) and 13 (from 10^12 on) are times in nano-, micro- and
// milliseconds since 1970, others from 10^14 on nanoseconds, and two numbers with a point between
// them, or two that change of which the first has nine or ten digits, seconds and their fraction.
// Throws InputError if there are no images, or two have one number.
FootageList list_footage(const std::vector<std::string>& source);

// The same of these files by their names alone, which are ascending: no matter whether they are
// there any more. `source`: what a note calls them.
FootageList order_footage(const std::vector<std::filesystem::path>& files,
                          const std::string& source);

}  // namespace hybrid_slam
