#include "frontend/input/footage_images.h"

#include <glob.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <string_view>

#include "frontend/input/image_file.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;  // [ns]

bool is_digit(char c) { return c >= '0' && c <= '9'; }

// A name cut into words and numbers, by turns; words come first and may be empty.
struct NameParts {
  std::vector<std::string> words;
  std::vector<std::string> numbers;
};

NameParts cut(std::string_view name) {
  NameParts parts;
  std::size_t at = 0;
  while (true) {
    std::size_t end = at;
    while (end < name.size() && !is_digit(name[end])) ++end;
    parts.words.emplace_back(name.substr(at, end - at));
    if (end == name.size()) return parts;
    at = end;
    while (end < name.size() && is_digit(name[end])) ++end;
    parts.numbers.emplace_back(name.substr(at, end - at));
    at = end;
  }
}

std::optional<std::int64_t> to_number(std::string_view digits) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return value;
}

// Digits behind a point as nanoseconds.
std::optional<std::int64_t> fraction(std::string digits) {
  digits.resize(9, '0');  // what is finer is cut off
  return to_number(digits);
}

std::vector<fs::path> matching(const std::string& pattern) {
  glob_t found{};
  std::vector<fs::path> paths;
  if (glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    for (std::size_t i = 0; i < found.gl_pathc; ++i) paths.emplace_back(found.gl_pathv[i]);
  }
  globfree(&found);
  return paths;
}

// The places of the numbers that are not the same in all names. None if the names are not built
// alike.
std::optional<std::vector<std::size_t>> changing_numbers(const std::vector<NameParts>& names) {
  std::vector<std::size_t> places;
  for (const NameParts& name : names) {
    if (name.words != names[0].words) return std::nullopt;
  }
  for (std::size_t i = 0; i < names[0].numbers.size(); ++i) {
    const auto same = [&](const NameParts& n) { return n.numbers[i] == names[0].numbers[i]; };
    if (!std::all_of(names.begin(), names.end(), same)) places.push_back(i);
  }
  return places;
}

// Whether number `place` and the next are one number with a point: "12.5", but not "cam0.1".
bool is_decimal(const NameParts& name, std::size_t place) {
  if (place + 1 >= name.numbers.size() || name.words[place + 1] != ".") return false;
  const std::string& before = name.words[place];
  return before.empty() || std::string_view("_- ").find(before.back()) != std::string_view::npos;
}

// Whether they are seconds since 1970 and what is behind the point.
bool is_split_stamp(const std::vector<NameParts>& names, std::size_t place) {
  constexpr std::size_t kLeastDigits = 9, kMostDigits = 10;
  return std::all_of(names.begin(), names.end(), [&](const NameParts& name) {
    const std::size_t digits = name.numbers[place].size();
    const std::size_t behind = name.numbers[place + 1].size();
    return digits >= kLeastDigits && digits <= kMostDigits && behind >= 3 &&
           behind == names[0].numbers[place + 1].size();
  });
}

// How a number's digits are to be multiplied to make it a time [ns]; 0: it is none.
std::int64_t stamp_unit(std::int64_t value, std::string& note) {
  constexpr std::int64_t kNanoseconds = 1'000'000'000'000'000'000;
  constexpr std::int64_t kMicroseconds = 1'000'000'000'000'000;
  constexpr std::int64_t kMilliseconds = 1'000'000'000'000;
  constexpr std::int64_t kLeastStamp = 100'000'000'000'000;
  if (value >= kNanoseconds) return 1;
  if (value >= kMicroseconds && value < 10 * kMicroseconds) {
    note = "the names' numbers are taken for times in microseconds";
    return 1000;
  }
  if (value >= kMilliseconds && value < 10 * kMilliseconds) {
    note = "the names' numbers are taken for times in milliseconds";
    return 1'000'000;
  }
  return value >= kLeastStamp ? 1 : 0;
}

struct Keys {
  NameOrder order = NameOrder::kNames;
  std::vector<std::int64_t> keys;
  std::string note;
};

Keys keys_of_seconds(const std::vector<NameParts>& names, std::size_t place) {
  Keys result{NameOrder::kStamps, {}, {}};
  for (const NameParts& name : names) {
    const auto seconds = to_number(name.numbers[place]);
    const auto behind = fraction(name.numbers[place + 1]);
    if (!seconds || !behind || *seconds > INT64_MAX / kSecond - 1) return {};
    result.keys.push_back(*seconds * kSecond + *behind);
  }
  return result;
}

Keys keys_of_numbers(const std::vector<NameParts>& names, std::size_t place) {
  Keys result{NameOrder::kNumbers, {}, {}};
  for (const NameParts& name : names) {
    const auto value = to_number(name.numbers[place]);
    if (!value) return {};
    result.keys.push_back(*value);
  }
  const std::int64_t unit = stamp_unit(result.keys.front(), result.note);
  if (unit == 0) return result;
  result.order = NameOrder::kStamps;
  for (std::int64_t& key : result.keys) {
    if (key > INT64_MAX / unit) return {};
    key *= unit;
  }
  return result;
}

Keys keys_of(const std::vector<NameParts>& names) {
  const auto changing = changing_numbers(names);
  if (!changing || names[0].numbers.empty()) return {};
  const std::vector<std::size_t>& places = *changing;
  if (places.size() > 2) return {};
  const std::size_t first = places.empty() ? names[0].numbers.size() - 1 : places.front();
  const std::size_t last = places.empty() ? first : places.back();
  for (const std::size_t place : {first, first - 1}) {  // where only the fraction changes
    if (place < names[0].numbers.size() && is_decimal(names[0], place) && last <= place + 1) {
      return keys_of_seconds(names, place);
    }
  }
  if (places.size() < 2) return keys_of_numbers(names, first);
  if (last == first + 1 && is_split_stamp(names, first)) return keys_of_seconds(names, first);
  return {};
}

}  // namespace

std::vector<fs::path> footage_files(const std::vector<std::string>& source) {
  std::vector<fs::path> paths;
  for (const std::string& one : source) {
    if (fs::is_directory(one)) {
      for (const fs::directory_entry& entry : fs::directory_iterator(one)) {
        if (has_image_extension(entry.path())) paths.push_back(entry.path());
      }
    } else if (fs::exists(one)) {
      paths.emplace_back(one);
    } else if (one.find_first_of("*?[") != std::string::npos) {
      const std::vector<fs::path> found = matching(one);
      paths.insert(paths.end(), found.begin(), found.end());
    } else {
      throw InputError(one + ": no such folder or file");
    }
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

FootageList list_footage(const std::vector<std::string>& source) {
  const std::vector<fs::path> paths = footage_files(source);
  if (paths.empty()) throw InputError(source.front() + ": holds no images");
  return order_footage(paths, source.front());
}

FootageList order_footage(const std::vector<fs::path>& files, const std::string& source) {
  std::vector<NameParts> names;
  for (const fs::path& path : files) names.push_back(cut(path.stem().string()));
  const Keys keys = keys_of(names);
  FootageList list;
  list.order = keys.keys.empty() ? NameOrder::kNames : keys.order;
  if (!keys.note.empty()) list.note = source + ": " + keys.note;
  for (std::size_t i = 0; i < files.size(); ++i) {
    list.images.push_back(
        {files[i], keys.keys.empty() ? static_cast<std::int64_t>(i) : keys.keys[i]});
  }
  std::stable_sort(list.images.begin(), list.images.end(),
                   [](const FootageImage& a, const FootageImage& b) { return a.key < b.key; });
  for (std::size_t i = 1; i < list.images.size(); ++i) {
    if (list.images[i].key != list.images[i - 1].key) continue;
    throw InputError(list.images[i].path.string() + ": same number as " +
                     list.images[i - 1].path.filename().string());
  }
  return list;
}

}  // namespace hybrid_slam
