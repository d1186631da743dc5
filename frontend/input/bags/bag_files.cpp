#include "frontend/input/bags/bag_files.h"

#include <algorithm>

#include <yaml-cpp/yaml.h>

#include "cameras/files/input_error.h"
#include "cameras/files/printable.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr const char* kMetadata = "metadata.yaml";
constexpr const char* kSection = "rosbag2_bagfile_information";

// rosbag2's section of metadata.yaml; undefined if the file is another's.
YAML::Node read_metadata(const fs::path& path) {
  try {
    const YAML::Node file = YAML::LoadFile(path.string());
    return file.IsMap() ? file[kSection] : YAML::Node(YAML::NodeType::Undefined);
  } catch (const YAML::Exception& error) {
    throw InputError(path.string() + ":" + std::to_string(error.mark.line + 1) + ": " + error.msg);
  }
}

bool has_bag_extension(const fs::path& path) {
  const std::string extension = path.extension().string();
  return extension == ".bag" || extension == ".db3" || extension == ".mcap";
}

std::vector<fs::path> bags_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && has_bag_extension(entry.path())) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

// Older versions wrote paths that begin at the folder above.
fs::path find_listed(const fs::path& folder, const fs::path& listed) {
  const fs::path beside = folder / listed.filename();
  return fs::exists(folder / listed) ? folder / listed : beside;
}

std::vector<fs::path> listed_files(const fs::path& folder, const YAML::Node& section,
                                   std::vector<std::string>& warnings) {
  std::vector<fs::path> files;
  const std::string metadata = (folder / kMetadata).string();
  const YAML::Node list = section["relative_file_paths"];
  if (!list.IsSequence()) throw InputError(metadata + ": relative_file_paths: is missing");
  for (const YAML::Node& entry : list) {
    if (!entry.IsScalar()) throw InputError(metadata + ": relative_file_paths: no list of files");
    const fs::path file = find_listed(folder, entry.Scalar());
    if (fs::exists(file)) {
      files.push_back(file);
    } else {
      warnings.push_back(metadata + ": lists " + printable(entry.Scalar()) + ", which is missing");
    }
  }
  return files;
}

}  // namespace

std::vector<fs::path> list_bag_files(const fs::path& path, std::vector<std::string>& warnings) {
  if (!fs::is_directory(path)) return {path};
  std::vector<fs::path> files;
  const fs::path metadata = path / kMetadata;
  if (fs::exists(metadata)) {
    if (const YAML::Node section = read_metadata(metadata); section) {
      files = listed_files(path, section, warnings);
    }
  }
  if (files.empty()) files = bags_in(path);
  if (files.empty()) throw InputError(path.string() + ": holds no bags (.bag, .db3, .mcap)");
  return files;
}

bool is_bag(const fs::path& path) {
  try {
    if (!fs::is_directory(path)) return fs::is_regular_file(path);
    if (fs::exists(path / kMetadata) && read_metadata(path / kMetadata)) return true;
    const auto is_folder = [](const fs::directory_entry& entry) { return entry.is_directory(); };
    const fs::directory_iterator entries(path);
    return std::none_of(begin(entries), end(entries), is_folder) && !bags_in(path).empty();
  } catch (const fs::filesystem_error&) {  // opening it will tell why
    return false;
  }
}

}  // namespace hybrid_slam
