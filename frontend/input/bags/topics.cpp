#include "frontend/input/bags/topics.h"

#include <algorithm>
#include <cctype>
#include <optional>

namespace hybrid_slam {

namespace {

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

bool contains(const std::string& topic, std::initializer_list<const char*> words) {
  const std::string name = lower(topic);
  return std::any_of(words.begin(), words.end(),
                     [&](const char* word) { return name.find(word) != std::string::npos; });
}

bool is_image(const BagTopic& topic) {
  return topic.serialization != Serialization::kOther &&
         (topic.type == kImageType || topic.type == kCompressedImageType);
}

bool is_compressed(const BagTopic& topic) { return topic.type == kCompressedImageType; }

std::string list_topics(const std::vector<BagTopic>& topics) {
  constexpr std::size_t kMost = 40;
  std::vector<BagTopic> sorted = topics;
  std::stable_partition(sorted.begin(), sorted.end(), is_image);
  std::string list;
  for (std::size_t i = 0; i < std::min(sorted.size(), kMost); ++i) {
    list += (i == 0 ? "" : ", ") + sorted[i].name + " (" + sorted[i].type + ", " +
            std::to_string(sorted[i].messages) + ")";
  }
  if (sorted.size() > kMost) list += ", ...";
  return sorted.empty() ? "there are no topics" : "there are " + list;
}

// The topic that an option names, with or without the slash in front.
std::string require_topic(const std::vector<BagTopic>& topics, const std::string& name,
                          const std::string& source) {
  for (const BagTopic& topic : topics) {
    if (is_image(topic) && (topic.name == name || topic.name == "/" + name)) return topic.name;
  }
  throw InputError(source + ": no images on topic " + name + "; " + list_topics(topics));
}

// What the name of the left camera's topic becomes for the right one: "left" to "right" in the same
// case, or a number to the next one. All possible ones.
std::vector<std::string> names_of_right(const std::string& left, bool by_number) {
  std::vector<std::string> names;
  const std::string name = lower(left);
  if (!by_number) {
    for (std::size_t at = name.find("left"); at != std::string::npos;
         at = name.find("left", at + 1)) {
      std::string right = "right";
      if (std::isupper(static_cast<unsigned char>(left[at + 1]))) right = "RIGHT";
      if (std::isupper(static_cast<unsigned char>(left[at]))) right[0] = 'R';
      names.push_back(std::string(left).replace(at, 4, right));
    }
    return names;
  }
  for (std::size_t i = 0; i < left.size(); ++i) {
    if (left[i] >= '0' && left[i] <= '8') {  // the last digit of a number
      const bool goes_on =
          i + 1 < left.size() && std::isdigit(static_cast<unsigned char>(left[i + 1]));
      if (goes_on) continue;
      names.push_back(left);
      ++names.back()[i];
    }
  }
  return names;
}

struct Pair {
  std::string left, right;
  int rank = 0;  // the higher, the likelier
};

int rank_of(const BagTopic& topic, bool by_number) {
  return (contains(topic.name, {"fish"}) ? 0 : 32) + (by_number ? 0 : 16) +
         (is_rectified_topic(topic.name) ? 8 : 0) + (is_compressed(topic) ? 0 : 4) +
         (contains(topic.name, {"mono", "gray", "grey"}) ? 2 : 0) +
         (contains(topic.name, {"color", "rgb"}) ? 0 : 1);
}

bool can_be_meant(const BagTopic& topic) {
  return is_image(topic) && topic.messages > 0 &&
         !contains(topic.name, {"depth", "disparity", "mask", "debug", "confidence", "theora"});
}

std::vector<Pair> find_pairs(const std::vector<BagTopic>& topics, const CameraTopics& wanted) {
  std::vector<Pair> pairs;
  for (const bool by_number : {false, true}) {
    for (const BagTopic& left : topics) {
      if (!can_be_meant(left) || (!wanted.left.empty() && left.name != wanted.left)) continue;
      for (const std::string& name : names_of_right(left.name, by_number)) {
        for (const BagTopic& right : topics) {
          if (right.name != name || right.type != left.type || !can_be_meant(right)) continue;
          if (!wanted.right.empty() && right.name != wanted.right) continue;
          pairs.push_back({left.name, right.name, rank_of(left, by_number)});
        }
      }
    }
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.rank > b.rank; });
  return pairs;
}

void find_pair(const std::vector<BagTopic>& topics, CameraTopics& chosen,
               const std::string& source) {
  constexpr const char* kSay = "--left-topic and --right-topic settle it";
  const std::vector<Pair> pairs = find_pairs(topics, chosen);
  if (pairs.empty()) {
    throw InputError(source + ": no two image topics are named as a stereo pair (" + kSay + "); " +
                     list_topics(topics));
  }
  if (pairs.size() > 1 && pairs[0].rank == pairs[1].rank) {
    throw InputError(source + ": several pairs of topics could be meant: " + pairs[0].left +
                     " and " + pairs[0].right + ", or " + pairs[1].left + " and " + pairs[1].right +
                     " (" + kSay + ")");
  }
  chosen.left = pairs[0].left;
  chosen.right = pairs[0].right;
}

std::string find_fisheye(const std::vector<BagTopic>& topics, const CameraTopics& chosen,
                         const std::string& source) {
  const auto is_candidate = [&](const BagTopic& topic) {
    return can_be_meant(topic) && contains(topic.name, {"fish", "wrist"}) &&
           topic.name != chosen.left && topic.name != chosen.right &&
           !is_rectified_topic(topic.name);
  };
  std::optional<BagTopic> best;
  for (const BagTopic& topic : topics) {
    if (!is_candidate(topic)) continue;
    if (!best || rank_of(topic, false) > rank_of(*best, false)) {
      best = topic;
    } else if (rank_of(topic, false) == rank_of(*best, false)) {
      throw InputError(source + ": several topics could be the fisheye's: " + best->name + ", " +
                       topic.name + " (--fisheye-topic settles it)");
    }
  }
  return best ? best->name : "";
}

}  // namespace

CameraTopics choose_topics(const std::vector<BagTopic>& topics, const CameraTopics& wanted,
                           bool with_fisheye, const std::string& source) {
  CameraTopics chosen;
  if (!wanted.left.empty()) chosen.left = require_topic(topics, wanted.left, source);
  if (!wanted.right.empty()) chosen.right = require_topic(topics, wanted.right, source);
  if (chosen.left.empty() || chosen.right.empty()) find_pair(topics, chosen, source);
  if (chosen.left == chosen.right) {
    throw InputError(source + ": " + chosen.left + " cannot be both left and right");
  }
  if (with_fisheye) {
    chosen.fisheye = wanted.fisheye.empty() ? find_fisheye(topics, chosen, source)
                                            : require_topic(topics, wanted.fisheye, source);
  }
  return chosen;
}

bool is_rectified_topic(const std::string& topic) {
  return contains(topic, {"/rect", "_rect", "-rect"}) || lower(topic).starts_with("rect");
}

std::string camera_info_topic(const std::string& topic) {
  constexpr std::string_view kTransport = "/compressed";
  std::string base = topic;
  if (base.ends_with(kTransport)) base.resize(base.size() - kTransport.size());
  const std::size_t slash = base.rfind('/');
  return (slash == std::string::npos ? "" : base.substr(0, slash)) + "/camera_info";
}

}  // namespace hybrid_slam
