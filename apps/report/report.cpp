#include "apps/report/report.h"

#include <nlohmann/json.hpp>
#include <optional>

#include "apps/report/page.h"
#include "apps/report/report_data.h"
#include "cameras/files/output_file.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kDataBytes = 4'900'000;  // page, style and script are below 100,000

Json read_json(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) return Json();
  try {
    return Json::parse(read_text_file(path));
  } catch (const Json::parse_error& error) {
    throw InputError(path.string() + ": no JSON (byte " + std::to_string(error.byte) + ")");
  }
}

ResultTable read_table(const std::filesystem::path& path) {
  return std::filesystem::exists(path) ? ResultTable(path) : ResultTable();
}

std::string text_at(const Json& json, const char* key) {
  const bool there = json.is_object() && json.contains(key) && json.at(key).is_string();
  return there ? json.at(key).get<std::string>() : std::string();
}

ReportContent gather(const ReportSources& sources) {
  ReportContent content;
  if (!sources.folder.empty()) {
    content.summary = read_json(sources.folder / "summary.json");
    content.timing = read_json(sources.folder / "timing.json");
    content.loops = read_table(sources.folder / "loops.csv");
    content.errors = read_table(sources.folder / "errors.csv");
    content.calibration = read_table(sources.folder / "calibration.csv");
    content.story = read_story(sources.folder, sources.map);
  }
  content.title = sources.title.empty() ? text_at(content.summary, "sequence") : sources.title;
  if (sources.map != nullptr) {
    content.figures = sources.figures != nullptr ? *sources.figures : map_figures(*sources.map);
    content.coverage = find_coverage(content.figures);
    for (std::size_t i = 0; i < sources.map->camera_count(); ++i) {
      content.cameras.push_back(sources.map->camera(CameraId(static_cast<std::uint32_t>(i))));
    }
  }
  if (sources.info != nullptr) {
    content.map_program = sources.info->program;
    content.map_options = sources.info->options;
  }
  if (sources.sequence != nullptr) {
    content.pictures = take_pictures(content.story, content.loops, *sources.sequence);
  }
  return content;
}

// A map file, or a folder of results with whatever is in it.
class Input {
 public:
  explicit Input(const std::filesystem::path& input) {
    const bool is_folder = std::filesystem::is_directory(input);
    const std::filesystem::path map_file = is_folder ? input / "map.hslam" : input;
    if (is_folder) {
      sources_.folder = input;
      if (!std::filesystem::exists(input / "frames.csv") && !std::filesystem::exists(map_file)) {
        throw InputError(input.string() +
                         ": neither frames.csv nor map.hslam: no results of a run");
      }
      sequence_ = dataset_of(input);
    } else {
      sources_.title = input.filename().string();
    }
    if (!is_folder || std::filesystem::exists(map_file)) {
      loaded_ = load_map(map_file);
      sources_.map = &loaded_->map.view();
      sources_.info = &loaded_->info;
    }
    sources_.sequence = sequence_.get();
  }
  Input(const Input&) = delete;
  Input& operator=(const Input&) = delete;

  const ReportSources& sources() const { return sources_; }

 private:
  std::optional<LoadedMap> loaded_;
  std::unique_ptr<ImageSequence> sequence_;
  ReportSources sources_;
};

}  // namespace

std::unique_ptr<ImageSequence> dataset_of(const std::filesystem::path& folder) {
  const Json summary = read_json(folder / "summary.json");
  const std::string dataset = text_at(summary, "dataset");
  if (dataset.empty() || !std::filesystem::exists(dataset)) return nullptr;
  try {
    return open_sequence(dataset, SequenceLayout::kAuto, text_at(summary, "sequence"),
                         SequenceCameras::kAuto);
  } catch (const InputError&) {
    return nullptr;
  }
}

void write_report(const std::filesystem::path& page, const ReportSources& sources) {
  const ReportContent content = gather(sources);
  write_file(page, report_page(content.title, report_data(content, kDataBytes)));
}

std::filesystem::path report_of(const std::filesystem::path& input,
                                const std::filesystem::path& page) {
  const Input loaded(input);
  const std::filesystem::path folder =
      std::filesystem::is_directory(input) ? input : input.parent_path();
  const std::filesystem::path to = page.empty() ? folder / "report.html" : page;
  write_report(to, loaded.sources());
  return to;
}

std::string served_report(const std::filesystem::path& folder) {
  const Input loaded(folder);
  const ReportContent content = gather(loaded.sources());
  Json data = Json::parse(report_data(content, kDataBytes));
  data["served"] = true;
  return report_page(content.title, data.dump(), PageOrigin::kServer);
}

}  // namespace hybrid_slam
