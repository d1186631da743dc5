#include "apps/report/report_data.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/report/frame_data.h"
#include "apps/report/map_data.h"
#include "apps/report/page_arrays.h"
#include "apps/report/verdict.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kLandmarkBytes = 26;  // of one in the page: 18 as base64, and some to spare

Json loops_json(const ResultTable& loops) {
  Json list = Json::array();
  for (std::size_t i = 0; i < loops.size(); ++i) {
    Json entry = {{"outcome", std::string(loops.text(i, "outcome"))}};
    for (const char* column : {"time", "match_time", "matches", "inliers", "final_matches",
                               "found_share", "off_m", "off_deg", "joins"}) {
      const double value = loops.number(i, column);
      entry[column] = std::isfinite(value) ? Json(value) : Json();
    }
    list.push_back(entry);
  }
  return list;
}

// calibration.csv: what is systematic, by place in the image.
Json calibration_json(const ResultTable& cells) {
  Json list = Json::array();
  for (std::size_t i = 0; i < cells.size(); ++i) {
    Json entry = {{"camera", std::string(cells.text(i, "camera"))}};
    for (const char* column : {"column", "row", "count", "mean_row_px", "mean_disparity_px",
                               "floor_px", "floor_disparity_px"}) {
      const double value = cells.number(i, column);
      entry[column] = std::isfinite(value) ? Json(value) : Json();
    }
    list.push_back(entry);
  }
  return list;
}

Json pictures_json(const std::vector<MomentPicture>& pictures) {
  Json list = Json::array();
  for (const MomentPicture& picture : pictures) {
    list.push_back({{"camera", picture.stereo ? "stereo" : "fisheye"},
                    {"time", picture.time},
                    {"why", picture.why},
                    {"width", picture.width},
                    {"height", picture.height},
                    {"jpeg", base64(picture.jpeg.data(), picture.jpeg.size())}});
  }
  return list;
}

}  // namespace

std::string report_data(const ReportContent& content, std::size_t bytes) {
  const RunStory& story = content.story;
  Json data;
  data["format"] = 1;
  data["title"] = content.title;
  data["verdict"] = verdict(content.summary, story, content.figures);
  data["summary"] = content.summary;
  data["timing"] = content.timing;
  data.update(story_json(story));
  data["residuals"] = residuals_json(content.figures);
  data["landmark_sigma_mm"] = landmark_sigma_json(content.figures);
  data["coverage"] = to_json(content.coverage, content.figures);
  data["map_program"] = content.map_program;
  data["map_options"] = content.map_options;
  data["cameras"] = cameras_json(content.cameras);
  data["frames"] = frames_json(story);
  data["loops"] = loops_json(content.loops);
  data["calibration_cells"] = calibration_json(content.calibration);
  data["truth"] = truth_json(content.errors);
  data["keyframes"] = keyframes_json(content.figures.keyframes, story);
  data["coverage_grid"] = coverage_grid_json(content.coverage);
  data["residual_grids"] = residual_grids_json(content.figures);
  data["pictures"] = pictures_json(content.pictures);
  const auto dump = [&] { return data.dump(-1, ' ', false, Json::error_handler_t::replace); };
  const std::size_t rest = dump().size();
  data["landmarks"] =
      landmarks_json(content.figures.landmarks, rest < bytes ? (bytes - rest) / kLandmarkBytes : 0);
  return dump();
}

}  // namespace hybrid_slam
