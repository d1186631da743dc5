#include <xxhash.h>

#include <catch2/catch.hpp>

#include "backend/map/byte_stream.h"
#include "backend/map/map_file.h"
#include "backend/map/map_file_format.h"
#include "test/support/allocation_watch.h"
#include "test/support/random_edits.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

// A small map with tombstones, saved in a folder of its own.
class SavedMap {
 public:
  SavedMap() {
    SyntheticSceneOptions options;
    options.times = 6;
    options.landmarks = 150;
    options.fisheye = true;
    FillOptions fill;
    fill.odometry = true;
    FilledMap filled = fill_map(make_synthetic_scene(options), fill);
    MapEdit edit;
    edit.erased_keyframes = {filled.keyframes[4], filled.keyframes[5]};
    filled.map.apply(edit);
    RigCorrection found;
    found.rows = PairAlignment{3e-3, -2e-3, 5e-3, 412, 1.6, 0.3, 1e-5, 2e-5, 3e-5};
    found.disparity = FoundParameter{1.25, 0.02, 0.2, 1.2};
    filled.map.set_correction(CameraId(0), found);
    save_map(path(), filled.map.view(), {"program", "options"});
    bytes_ = read_text(path());
    SectionFileReader reader(path(), kMapFileFormat);
    for (std::size_t i = 0; i < reader.sections().size(); ++i) {
      sections_.emplace_back(reader.sections()[i].name, reader.read(i));
    }
  }

  fs::path path() const { return folder_.path() / "map"; }
  const std::string& bytes() const { return bytes_; }

  using Sections = std::vector<std::pair<std::string, std::string>>;
  const Sections& sections() const { return sections_; }

  std::string& content(Sections& sections, std::string_view name) const {
    for (auto& [section, content] : sections) {
      if (section == name) return content;
    }
    throw std::logic_error("no such section");
  }

  // A file with right checksums, whatever the sections hold.
  void write(const Sections& sections) const {
    SectionFileWriter writer(path(), kMapFileFormat);
    for (const auto& [name, content] : sections) writer.add(name, content);
    writer.commit();
  }

 private:
  TempFolder folder_;
  std::string bytes_;
  Sections sections_;
};

// The one line with which a file is refused; empty if it was loaded, with `faults` in the map.
std::string refusal(const fs::path& path, std::vector<std::string>* faults = nullptr) {
  try {
    const LoadedMap loaded = load_map(path);
    if (faults != nullptr) *faults = loaded.map.check_consistency();
  } catch (const InputError& error) {
    const std::string line = error.what();
    CHECK(line.starts_with(path.string() + ": "));
    CHECK(line.find('\n') == std::string::npos);
    return line;
  }
  return {};
}

template <typename T>
void put(std::string& bytes, std::size_t at, T value) {
  ByteWriter number;
  number.number(value);
  bytes.replace(at, sizeof(T), number.content());
}

// The table's checksum, which covers the header, the table and its size.
void mend_table(std::string& file) {
  ByteReader footer(std::string_view(file).substr(file.size() - 24), "end");
  const auto size = footer.number<std::uint64_t>();
  const std::string covered = file.substr(0, 12) + file.substr(file.size() - 24 - size, size + 8);
  put(file, file.size() - 16, XXH3_64bits(covered.data(), covered.size()));
}

TEST_CASE("a file cut off or with a flipped bit is refused, anywhere") {
  const SavedMap saved;
  REQUIRE(refusal(saved.path()).empty());
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    std::string bytes = saved.bytes();
    const std::size_t at = random.below(bytes.size());
    if (i % 2 == 0) {
      bytes.resize(at);
    } else {
      bytes[at] = static_cast<char>(bytes[at] ^ (1 << random.below(8)));
    }
    write_text(saved.path(), bytes);
    INFO("byte " << at << " of " << bytes.size());
    CHECK_FALSE(refusal(saved.path()).empty());
  }
}

TEST_CASE("every byte of header and table counts, and so does one too many") {
  const SavedMap saved;
  const std::string& whole = saved.bytes();
  std::vector<std::size_t> places;
  for (std::size_t at = 0; at < 12; ++at) places.push_back(at);
  for (std::size_t at = whole.size() - 300; at < whole.size(); ++at) places.push_back(at);
  for (const std::size_t at : places) {
    std::string bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ 1);
    write_text(saved.path(), bytes);
    INFO("byte " << at);
    CHECK_FALSE(refusal(saved.path()).empty());
  }
  write_text(saved.path(), whole + '\0');
  CHECK_FALSE(refusal(saved.path()).empty());
}

TEST_CASE("a damaged file is refused with its name, the place and the reason") {
  const SavedMap saved;
  std::string bytes = saved.bytes();
  const std::string path = saved.path().string();
  const auto refused_as = [&](const std::string& reason) {
    write_text(saved.path(), bytes);
    CHECK(refusal(saved.path()) == path + ": " + reason);
  };
  SECTION("cut off") {
    bytes.resize(bytes.size() / 2);
    refused_as("its end is missing: cut off or damaged");
  }
  SECTION("empty") {
    bytes.clear();
    refused_as("too short to be a map file");
  }
  SECTION("of another kind") {
    bytes.replace(0, 4, "PK\3\4");
    refused_as("no map file");
  }
  SECTION("of a later version") {
    bytes[8] = 6;
    refused_as("version 6 of the format, where this program knows 2 to 5");
  }
  SECTION("of an earlier version") {
    bytes[8] = 1;
    refused_as("version 1 of the format, where this program knows 2 to 5");
  }
  SECTION("a byte changed") {
    bytes[bytes.size() / 2] ^= 4;
    write_text(saved.path(), bytes);
    CHECK_THAT(refusal(saved.path()), Catch::StartsWith(path + ": section ") &&
                                          Catch::EndsWith("wrong checksum: the file is damaged"));
  }
  SECTION("a folder, or nothing") {
    CHECK(refusal(saved.path().parent_path()) ==
          saved.path().parent_path().string() + ": cannot be read");
    fs::remove(saved.path());
    CHECK(refusal(saved.path()) == path + ": cannot be read");
  }
}

TEST_CASE("content that is wrong under right checksums is refused or consistent, never a crash") {
  const SavedMap saved;
  Random random(2);
  int refused = 0;
  constexpr int kTrials = 600;
  for (int i = 0; i < kTrials; ++i) {
    auto sections = saved.sections();
    std::string& content = sections[random.below(sections.size())].second;
    switch (random.below(3)) {
      case 0:
        content.resize(random.below(content.size()));
        break;
      case 1:
        content[random.below(content.size())] ^= static_cast<char>(1 << random.below(8));
        break;
      default:  // a run of ones, of zeros, or something from elsewhere
        const std::size_t at = random.below(content.size());
        const std::size_t size = std::min<std::size_t>(1 + random.below(8), content.size() - at);
        const std::size_t from = random.below(content.size() - size + 1);
        const std::string with[] = {std::string(size, '\xff'), std::string(size, '\0'),
                                    content.substr(from, size)};
        content.replace(at, size, with[random.below(3)]);
    }
    saved.write(sections);
    std::vector<std::string> faults;
    const std::string line = refusal(saved.path(), &faults);
    refused += line.empty() ? 0 : 1;
    CHECK(faults == std::vector<std::string>{});
  }
  CHECK(refused > kTrials / 3);  // keypoints and descriptors, the bulk, may be anything
}

TEST_CASE("sections that are missing, doubled or out of order are refused") {
  const SavedMap saved;
  const auto refused = [&](const SavedMap::Sections& sections) {
    saved.write(sections);
    CHECK_FALSE(refusal(saved.path()).empty());
  };
  const SavedMap::Sections& all = saved.sections();
  REQUIRE(all.size() == 8);
  for (std::size_t i = 0; i < all.size(); ++i) {
    INFO("section " << all[i].first);
    auto sections = all;
    sections.erase(sections.begin() + static_cast<std::ptrdiff_t>(i));
    refused(sections);
    sections = all;
    sections.insert(sections.begin() + static_cast<std::ptrdiff_t>(i), all[i]);
    refused(sections);
    sections = all;
    std::swap(sections[i], sections[(i + 1) % all.size()]);
    refused(sections);
    sections = all;
    sections[i].first = "unknown";
    refused(sections);
  }
}

TEST_CASE("a value out of range is refused with the section and the reason") {
  const SavedMap saved;
  auto sections = saved.sections();
  const auto refused_as = [&](std::string_view section, const std::string& reason) {
    saved.write(sections);
    CHECK_THAT(refusal(saved.path()), Catch::Contains("(" + std::string(section) + "): " + reason));
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  std::string& keyframes = saved.content(sections, kKeyframesSection);
  std::string& landmarks = saved.content(sections, kLandmarksSection);
  std::string& state = saved.content(sections, kStateSection);
  std::string& odometry = saved.content(sections, kOdometrySection);
  std::string& corrections = saved.content(sections, kCorrectionsSection);
  // Places in the first keyframe: id 0, parent 4, keep 8, pose 9, camera 65, frame 69, time 77,
  // kind 85, right 86, count 87, keypoints from 91.
  SECTION("pose") {
    put(keyframes, 9, kNan);
    refused_as(kKeyframesSection, "pose is not finite");
  }
  SECTION("rotation") {
    put(keyframes, 9 + 24, 2.0);
    refused_as(kKeyframesSection, "pose whose quaternion");
  }
  SECTION("camera") {
    put(keyframes, 65, std::uint32_t{2});
    refused_as(kKeyframesSection, "unknown camera");
  }
  SECTION("right coordinates of a fisheye") {
    put(keyframes, 65, std::uint32_t{1});
    refused_as(kKeyframesSection, "right coordinates");
  }
  SECTION("time") {
    put(keyframes, 77, kNan);
    refused_as(kKeyframesSection, "time is not finite");
  }
  SECTION("kind") {
    put(keyframes, 85, std::uint8_t{9});
    refused_as(kKeyframesSection, "unknown kind of descriptor");
  }
  SECTION("kinds") {
    put(keyframes, 85, std::uint8_t{1});
    refused_as(kKeyframesSection, "descriptors of several kinds");
  }
  SECTION("keypoint") {
    put(keyframes, 91, std::numeric_limits<float>::infinity());
    refused_as(kKeyframesSection, "keypoint that is not finite");
  }
  // In the first landmark: id 0, point 4, reference 28, direction 32, scale 56, visible 64, found
  // 68, count 72, observations from 76.
  SECTION("point") {
    put(landmarks, 4, kNan);
    refused_as(kLandmarksSection, "point is not finite");
  }
  SECTION("counter") {
    put(landmarks, 64, -1);
    refused_as(kLandmarksSection, "counter out of range");
  }
  SECTION("keyframe of an observation") {
    put(landmarks, 76, std::uint32_t{4});  // erased
    refused_as(kLandmarksSection, "observation by a keypoint that does not exist");
  }
  SECTION("keypoint of an observation") {
    put(landmarks, 80, std::uint32_t{100000});
    refused_as(kLandmarksSection, "observation by a keypoint that does not exist");
  }
  // In the first odometry: id 0, previous 4, motion 8, covariance 64, count 232, keypoints from
  // 236.
  SECTION("odometry of a keyframe that is not there") {
    put(odometry, 0, std::uint32_t{4});  // erased
    refused_as(kOdometrySection, "odometry of an unknown keyframe");
  }
  SECTION("covariance") {
    put(odometry, 64, -1.0);
    refused_as(kOdometrySection, "odometry without a covariance");
  }
  SECTION("keypoint of odometry") {
    put(odometry, 236, std::uint32_t{100000});
    refused_as(kOdometrySection, "odometry without a covariance, or by keypoints");
  }
  // Of camera 0: id 0, rows 4, pitch 5, roll 13, focal ratio 21, three sigmas from 29, matches 53,
  // rms 57, sigma 65; offset 73, its value 74, sigma 82, systematic 90, in use 98; shading 106.
  SECTION("correction of a fisheye") {
    put(corrections, 0, std::uint32_t{1});
    refused_as(kCorrectionsSection, "correction of a camera that is no stereo pair");
  }
  SECTION("camera that is turned away") {
    put(corrections, 5, 1.0);
    refused_as(kCorrectionsSection, "pair that cannot be aligned");
  }
  SECTION("parameter without a sigma") {
    put(corrections, 82, 0.0);
    refused_as(kCorrectionsSection, "parameter without a standard deviation");
  }
  SECTION("id") {
    put(landmarks, 0, std::uint32_t{1} << 30);
    refused_as(kLandmarksSection, "id out of order or out of range");
  }
  SECTION("state: a keyframe that never was") {
    put(state, 4, std::uint32_t{13});
    refused_as(kStateSection, "keyframes that were neither kept nor erased");
  }
}

TEST_CASE("a map that contradicts itself is refused") {
  const SavedMap saved;
  auto sections = saved.sections();
  const auto refused_as = [&](const std::string& reason) {
    saved.write(sections);
    CHECK_THAT(refusal(saved.path()), Catch::Contains(": no consistent map: " + reason));
  };
  std::string& landmarks = saved.content(sections, kLandmarksSection);
  SECTION("an attribute that does not follow from the observations") {
    put(landmarks, 56, 1.0);
    refused_as("landmark 0: stale scale");
  }
  SECTION("a reference that does not see the landmark") {
    put(landmarks, 28, std::uint32_t{4});
    refused_as("landmark 0: not seen by its reference");
  }
  SECTION("odometry from elsewhere than the keyframe before") {
    put(saved.content(sections, kOdometrySection), 4, std::uint32_t{7});
    refused_as("keyframe 2: odometry that does not begin at the keyframe before");
  }
  SECTION("a tree with a circle") {
    const std::size_t second =
        saved.content(sections, kKeyframesSection)
            .find(std::string("\1\0\0\0\0\0\0\0\0", 9));  // keyframe 1, parent 0, not to keep
    REQUIRE(second != std::string::npos);
    put(saved.content(sections, kKeyframesSection), second + 4, std::uint32_t{1});
    refused_as("keyframe 1: not in the spanning tree");
  }
  SECTION("tombstones in a circle") {
    put(saved.content(sections, kErasedSection), 4, std::uint32_t{4});
    refused_as("keyframe 4: tombstone leads nowhere");
  }
}

TEST_CASE("absurd counts and sizes are refused before anything is allocated") {
  const SavedMap saved;
  auto sections = saved.sections();
  std::string file = saved.bytes();
  constexpr auto kHuge = std::numeric_limits<std::uint32_t>::max();
  constexpr std::size_t kAllowed = 1 << 20;
  const auto is_cheap = [&] {
    const AllocationWatch watch;
    CHECK_FALSE(refusal(saved.path()).empty());
    CHECK(watch.largest() < kAllowed);
  };
  SECTION("keypoints") {
    put(saved.content(sections, kKeyframesSection), 87, kHuge);
    saved.write(sections);
    is_cheap();
  }
  SECTION("observations") {
    put(saved.content(sections, kLandmarksSection), 72, kHuge);
    saved.write(sections);
    is_cheap();
  }
  SECTION("text") {
    put(saved.content(sections, kInfoSection), 0, std::uint64_t{1} << 60);
    saved.write(sections);
    is_cheap();
  }
  SECTION("keyframes and landmarks altogether") {
    std::string& state = saved.content(sections, kStateSection);
    put(state, 4, kHuge - 1);
    put(state, 8, kHuge - 1);
    put(state, 20, kHuge - 3);
    put(state, 28, kHuge - 1);
    saved.write(sections);
    is_cheap();
  }
  // In the table, which begins with the count of its entries of 41 bytes each.
  const std::size_t table = file.size() - 24 - (4 + 6 * 41);
  SECTION("sections") {
    put(file, table, kHuge);
    mend_table(file);
    write_text(saved.path(), file);
    is_cheap();
  }
  for (const std::size_t place : {17, 25}) {  // bytes in the file, bytes of content
    for (const std::uint64_t size :
         {std::uint64_t{1} << 27, std::uint64_t{1} << 40, ~std::uint64_t{0}}) {
      DYNAMIC_SECTION("a section's size at " << place << ": " << size) {
        put(file, table + 4 + 3 * 41 + place, size);
        mend_table(file);
        write_text(saved.path(), file);
        is_cheap();
      }
    }
  }
  SECTION("unless the table is right") {
    mend_table(file);
    write_text(saved.path(), file);
    CHECK(refusal(saved.path()).empty());
  }
}

}  // namespace
}  // namespace hybrid_slam
