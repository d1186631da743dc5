#include "apps/map_tool/verbs.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/io/report.h"
#include "apps/map_tool/map_crop.h"
#include "apps/map_tool/map_export.h"
#include "apps/map_tool/map_info.h"
#include "apps/map_tool/map_merge.h"
#include "apps/map_tool/map_verify.h"
#include "apps/program/program.h"
#include "cameras/files/input_error.h"
#include "frontend/place_recognition/default_vocabulary.h"
#include "frontend/place_recognition/vocabulary_file.h"

namespace hybrid_slam {
namespace {

const std::map<std::string, ExportFormat> kFormats{{"colmap", ExportFormat::kColmap},
                                                   {"colmap-binary", ExportFormat::kColmapBinary},
                                                   {"nerfstudio", ExportFormat::kNerfstudio},
                                                   {"tum", ExportFormat::kTum},
                                                   {"kitti", ExportFormat::kKitti},
                                                   {"euroc", ExportFormat::kEuroc},
                                                   {"ply", ExportFormat::kPly}};

CLI::Option* add_map(CLI::App& verb, std::string& map) {
  return verb.add_option("MAP", map, "a map file (.hslam)")->required();
}

// What fails without knowing the file's name.
template <typename F>
auto named(const std::string& path, F&& work) {
  try {
    return work();
  } catch (const InputError& error) {
    throw InputError(path + ": " + error.what());
  }
}

MapFileInfo made_by(const std::string& verb, const MapFileInfo& from) {
  return {fmt::format("map_tool {} of {}", verb, from.program), from.options};
}

}  // namespace

void check_output(const std::string& out, const std::vector<std::string>& inputs) {
  for (const std::string& input : inputs) {
    std::error_code ignored;
    if (std::filesystem::equivalent(out, input, ignored)) {
      throw InputError(out + ": is an input, which is never changed");
    }
  }
}

Verb add_info(CLI::App& app) {
  struct Line {
    std::string map, json;
  };
  const auto line = std::make_shared<Line>();
  CLI::App& verb = *app.add_subcommand("info", "what is in a map");
  add_map(verb, line->map);
  verb.add_option("--json", line->json, "writes it to this file, too")->option_text("FILE");
  return [line] {
    const LoadedMap loaded = load_map(line->map);
    const MapInfo info = map_info(loaded.map.view(), loaded.info);
    if (!line->json.empty()) {
      check_output(line->json, {line->map});
      write_json(line->json, to_json(info));
    }
    fmt::print("{}", to_text(info));
    return static_cast<int>(kExitOk);
  };
}

Verb add_verify(CLI::App& app) {
  const auto map = std::make_shared<std::string>();
  CLI::App& verb = *app.add_subcommand("verify", "checks a map's consistency");
  add_map(verb, *map);
  return [map] {
    const LoadedMap loaded = read_map_unchecked(*map);
    const std::vector<std::string> faults = map_faults(loaded.map);
    for (const std::string& fault : faults) fmt::print("{}\n", fault);
    fmt::print("{}: {}\n", *map,
               faults.empty() ? "sound" : fmt::format("{} faults", faults.size()));
    return faults.empty() ? static_cast<int>(kExitOk) : kExitUnsound;
  };
}

Verb add_crop(CLI::App& app) {
  struct Line {
    std::string map, out;
    std::vector<double> box;
    double from = 0, to = 0;
    std::uint32_t component = 0;
    CropOptions options;
  };
  const auto line = std::make_shared<Line>();
  CLI::App& verb = *app.add_subcommand("crop", "a part of a map: what fits all that is given");
  add_map(verb, line->map);
  auto* const box =
      verb.add_option("--box", line->box, "landmarks inside, and keyframes that see 15 of them [m]")
          ->option_text("x0,y0,z0,x1,y1,z1")
          ->delimiter(',')
          ->expected(6);
  auto* const from = verb.add_option("--from", line->from, "keyframes of this time [s] and later")
                         ->option_text("T");
  auto* const to =
      verb.add_option("--to", line->to, "keyframes of this time [s] and before")->option_text("T");
  auto* const component =
      verb.add_option("--component", line->component, "as info names it")->option_text("N");
  verb.add_option("--out", line->out, "the map file to write")->option_text("FILE")->required();
  verb.callback([=] {
    if (box->empty() && from->empty() && to->empty() && component->empty()) {
      throw CLI::ValidationError("crop: --box, --from, --to or --component is needed");
    }
    const auto is_number = [](double value) { return std::isfinite(value); };
    if (!std::all_of(line->box.begin(), line->box.end(), is_number) || !is_number(line->from) ||
        !is_number(line->to)) {
      throw CLI::ValidationError("crop: not a number");
    }
    CropOptions& options = line->options;
    if (!box->empty()) {
      const std::vector<double>& b = line->box;
      options.box = Eigen::AlignedBox3d(Eigen::Vector3d(b[0], b[1], b[2]));
      options.box->extend(Eigen::Vector3d(b[3], b[4], b[5]));
    }
    if (!from->empty()) options.from = line->from;
    if (!to->empty()) options.to = line->to;
    if (!component->empty()) options.component = KeyframeId(line->component);
  });
  return [line] {
    check_output(line->out, {line->map});
    const LoadedMap loaded = load_map(line->map);
    const MapSnapshot& map = loaded.map.view();
    const Map cropped = named(line->map, [&] { return crop_map(map, line->options); });
    save_map(line->out, cropped.view(), made_by("crop", loaded.info));
    fmt::print("{} of {} keyframes, {} of {} landmarks, to {}\n", cropped.view().keyframe_count(),
               map.keyframe_count(), cropped.view().landmark_count(), map.landmark_count(),
               line->out);
    return static_cast<int>(kExitOk);
  };
}

Verb add_export(CLI::App& app) {
  struct Line {
    std::string map, out;
    ExportOptions options;
  };
  const auto line = std::make_shared<Line>();
  CLI::App& verb = *app.add_subcommand("export", "a map as other programs read it");
  add_map(verb, line->map);
  verb.add_option("--format", line->options.format,
                  "colmap, colmap-binary, nerfstudio, tum, kitti, euroc or ply")
      ->transform(CLI::CheckedTransformer(kFormats).description(""))
      ->option_text("NAME")
      ->required();
  verb.add_option("--out", line->out, "folder for the results, made if missing")
      ->option_text("DIR")
      ->required();
  verb.add_option("--images", line->options.datasets,
                  "the dataset that the map was made of, whose images are named as they are there; "
                  "of a merged map, once per dive")
      ->option_text("DIR")
      ->allow_extra_args(false);
  return [line] {
    const LoadedMap loaded = load_map(line->map);
    line->options.out = line->out;
    const auto told = export_map(loaded.map.view(), line->options);
    for (const std::string& one : told) fmt::print("{}\n", one);
    return static_cast<int>(kExitOk);
  };
}

Verb add_merge(CLI::App& app) {
  struct Line {
    std::vector<std::string> maps;
    std::string out, json, vocabulary;
  };
  const auto line = std::make_shared<Line>();
  CLI::App& verb =
      *app.add_subcommand("merge", "joins maps of several dives by the places they share");
  verb.add_option("MAP", line->maps, "map files, two or more")->required()->expected(2, 1000);
  verb.add_option("--out", line->out, "the map file to write")->option_text("FILE")->required();
  verb.add_option("--json", line->json, "writes what was done to this file, too")
      ->option_text("FILE");
  verb.add_option("--vocabulary", line->vocabulary, "a file (default: the program's own)")
      ->option_text("FILE");
  return [line] {
    check_output(line->out, line->maps);
    if (!line->json.empty()) check_output(line->json, line->maps);
    const Vocabulary vocabulary =
        line->vocabulary.empty() ? default_vocabulary() : load_vocabulary(line->vocabulary);
    std::vector<LoadedMap> loaded;
    std::vector<const MapSnapshot*> maps;
    for (const std::string& path : line->maps) loaded.push_back(load_map(path));
    for (const LoadedMap& one : loaded) maps.push_back(&one.map.view());
    watch_signals();
    const MergeOptions options;
    const MergeResult result = named(
        line->maps.front(), [&] { return merge_maps(maps, vocabulary, options, interrupted); });
    if (result.interrupted) {
      spdlog::warn("interrupted: nothing is written");
      return static_cast<int>(kExitInterrupted);
    }
    save_map(line->out, result.map.view(), made_by("merge", loaded.front().info));
    if (!line->json.empty()) write_json(line->json, to_json(result.summary, line->maps));
    fmt::print("{}", to_text(result.summary, line->maps));
    return static_cast<int>(kExitOk);
  };
}

}  // namespace hybrid_slam
