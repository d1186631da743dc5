#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "apps/report/coverage.h"
#include "apps/report/map_figures.h"
#include "backend/map/map_file.h"
#include "frontend/input/image_sequence.h"

// The report of a run: one HTML file, at most 5 MB, that a browser shows without a network. It
// tells what the other files of the folder say; docs/report.md.

namespace hybrid_slam {

// What a report is made of, beside the files of a folder of results (summary.json, frames.csv,
// timing.json, timing.csv, loops.csv, errors.csv, calibration.csv; each may be missing).
struct ReportSources {
  std::filesystem::path folder;             // empty: there is no folder, only a map
  const MapSnapshot* map = nullptr;         // null: there is no map
  const MapFileInfo* info = nullptr;        // of the map; may be null
  const MapFigures* figures = nullptr;      // of the map; null: found here
  const ImageSequence* sequence = nullptr;  // to take pictures from; null: none
  std::string title;                        // empty: the name of the sequence
};

// Writes `page`, whole or not at all. Throws InputError for files of the folder that cannot be
// read, OutputError.
void write_report(const std::filesystem::path& page, const ReportSources& sources);

// For programs: the report of a map file, or of a folder of results with whatever is in it.
// Pictures are taken from the dataset that summary.json names, where it is still there. `page`
// empty: report.html beside the map or in the folder. Returns its path. Throws InputError if
// `input` is neither, OutputError.
std::filesystem::path report_of(const std::filesystem::path& input,
                                const std::filesystem::path& page = {});

// The same page of a folder of results for who serves it: the page may then ask for more
// (docs/view.md). Throws InputError.
std::string served_report(const std::filesystem::path& folder);

// The dataset that summary.json in a folder of results names. Null if it names none, or that is not
// there any more. Throws InputError if summary.json cannot be read.
std::unique_ptr<ImageSequence> dataset_of(const std::filesystem::path& folder);

}  // namespace hybrid_slam
