#include "apps/io/graphs/graph_file.h"

#include <algorithm>

#include "apps/io/graphs/bal.h"
#include "apps/io/graphs/colmap.h"
#include "apps/io/graphs/g2o.h"
#include "apps/io/graphs/map_graph.h"
#include "apps/io/graphs/stereo_graph.h"
#include "apps/io/graphs/stereo_stream.h"
#include "apps/io/graphs/text_scanner.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace {

namespace fs = std::filesystem;

bool is_whole_number(std::string_view field) {
  return !field.empty() &&
         std::all_of(field.begin(), field.end(), [](char c) { return c >= '0' && c <= '9'; });
}

// The kind of a file from its first line.
GraphFile read_graph_file(const fs::path& path) {
  if (is_map_file(path) || path.extension() == ".hslam") return read_map_graph(path);
  TextScanner in(path);
  if (!in.more()) throw InputError(path.string() + ": is empty");
  if (has_decimal_commas(in.whole_line())) in.fail("decimal commas; write numbers with a point");
  const std::string first(in.field("first field"));
  std::size_t fields = 1;
  bool whole_numbers = is_whole_number(first);
  for (; in.more_on_line(); ++fields) whole_numbers &= is_whole_number(in.field("field"));
  if (first.starts_with("VERTEX") || first.starts_with("EDGE") || first == "FIX" ||
      path.extension() == ".g2o") {
    return read_g2o(path);
  }
  if (first == "CAM" || path.extension() == ".seq") return read_stereo_stream(path);
  if (is_stereo_factors(path)) return read_stereo_graph(path);
  if (whole_numbers && fields <= 3) return read_bal(path);
  in.fail(quote(first) + " begins no kind of graph that is known");
}

GraphFile read_any(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) return read_graph_file(path);
  for (const ColmapVariant variant : {ColmapVariant::kBinary, ColmapVariant::kText}) {
    if (has_colmap_model(path, variant)) return read_colmap(path, variant);
  }
  return read_stereo_graph(path);
}

}  // namespace

std::string_view name_of(GraphFormat format) {
  switch (format) {
    case GraphFormat::kBal:
      return "bal";
    case GraphFormat::kG2o:
      return "g2o";
    case GraphFormat::kColmapText:
      return "colmap-text";
    case GraphFormat::kColmapBinary:
      return "colmap-binary";
    case GraphFormat::kStereoGraph:
      return "stereo-graph";
    case GraphFormat::kStereoStream:
      return "stereo-stream";
    case GraphFormat::kMap:
      return "map";
    case GraphFormat::kPly:
      return "ply";
  }
  throw std::logic_error("no such graph format");
}

GraphFile read_graph(const fs::path& path) {
  GraphFile file = read_any(path);
  if (auto writer = make_map_writer(file)) file.writers.push_back(std::move(*writer));
  return file;
}

}  // namespace hybrid_slam
