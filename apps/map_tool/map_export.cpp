#include "apps/map_tool/map_export.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "apps/io/ply.h"
#include "apps/map_tool/colmap_export.h"
#include "apps/map_tool/map_info.h"
#include "apps/map_tool/nerfstudio_export.h"
#include "apps/map_tool/trajectory_export.h"
#include "backend/map/components.h"
#include "backend/map/map_assembly.h"
#include "cameras/files/input_error.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

KeyframeId largest_component(const MapSnapshot& map) {
  const auto sizes = component_sizes(map);
  return std::max_element(sizes.begin(), sizes.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

bool names_images(ExportFormat format) {
  return format == ExportFormat::kColmap || format == ExportFormat::kColmapBinary ||
         format == ExportFormat::kNerfstudio;
}

// Another version's files would contradict those that are written now.
void write_colmap(const ColmapModel& model, const fs::path& folder) {
  remove_colmap_model(folder);
  if (model.variant == ColmapVariant::kText) {
    write_colmap_text(folder, model);
  } else {
    write_colmap_binary(folder, model);
  }
}

void write_component_ply(const MapSnapshot& map, KeyframeId component, const fs::path& path) {
  MapPart part;
  part.map = &map;
  part.keyframes = map.keyframe_ids();
  std::erase_if(part.keyframes, [&](KeyframeId id) { return map.at(id).component != component; });
  write_map_ply(path, assemble_map({&part, 1}).view());
}

class Export {
 public:
  Export(const MapSnapshot& map, const ExportOptions& options) : map_(map), options_(options) {
    if (names_images(options.format)) names_.emplace(map, options.datasets);
  }

  std::vector<std::string> run() {
    const KeyframeId largest = largest_component(map_);
    for (const auto& [component, size] : component_sizes(map_)) {
      const fs::path folder = component == largest
                                  ? options_.out
                                  : options_.out / fmt::format("component_{}", component.value);
      write(component, folder);
      told_.push_back(
          fmt::format("component {}: {} keyframes, to {}", component.value, size, folder.string()));
    }
    write_images();
    tell_corrections();
    return std::move(told_);
  }

 private:
  // A folder is made once there is something to write: not where an export is refused.
  void write(KeyframeId component, const fs::path& folder) {
    switch (options_.format) {
      case ExportFormat::kColmap:
      case ExportFormat::kColmapBinary: {
        const auto variant = options_.format == ExportFormat::kColmap ? ColmapVariant::kText
                                                                      : ColmapVariant::kBinary;
        ColmapLosses losses;
        const ColmapModel model = make_colmap_model(map_, component, *names_, variant, losses);
        write_colmap(model, make_folder(folder));
        if (losses.behind > 0) {
          told_.push_back(
              fmt::format("{} observations at 90 degrees or more from a fisheye's axis "
                          "are left out: COLMAP does not project them",
                          losses.behind));
        }
        return;
      }
      case ExportFormat::kNerfstudio:
        return export_nerfstudio(map_, component, *names_, options_.out / "images", folder);
      case ExportFormat::kPly:
        return write_component_ply(map_, component, make_folder(folder) / "map.ply");
      default:
        return export_trajectories(map_, component, options_.format, make_folder(folder));
    }
  }

  void write_images() {
    if (!names_) return;
    const std::size_t written = names_->write_rectified(options_.out / "images");
    if (written == 0) return;
    told_.push_back(fmt::format("{} rectified images, which the map is of, to {}", written,
                                (options_.out / "images").string()));
  }

  // No format of these has a place for it.
  void tell_corrections() {
    for (std::uint32_t i = 0; i < map_.camera_count(); ++i) {
      for (const std::string& line : correction_lines(map_.correction(CameraId(i)))) {
        told_.push_back(fmt::format("camera {}, not in the export: {}", i, line));
      }
    }
  }

  const MapSnapshot& map_;
  const ExportOptions& options_;
  std::optional<ImageNames> names_;
  std::vector<std::string> told_;
};

}  // namespace

std::vector<std::string> export_map(const MapSnapshot& map, const ExportOptions& options) {
  if (map.keyframe_count() == 0) throw InputError("the map is empty: nothing to export");
  return Export(map, options).run();
}

}  // namespace hybrid_slam
