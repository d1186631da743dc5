#include "apps/hybrid_slam/calibration_outputs.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>

#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kSystematic = 0.25;  // [px] half of what a keypoint's own place is good for

void judge_rows(const RigFindings& rig, std::vector<std::string>& reasons) {
  if (rig.alignment) {
    reasons.push_back(fmt::format(
        "rows are {:.2f} px off: the right camera is turned by {:.3f} deg about x and {:.3f} deg "
        "about z, its focal length is {:+.2f} % longer (taken out)",
        rig.alignment->row_rms, kDegrees * rig.alignment->pitch, kDegrees * rig.alignment->roll,
        100 * rig.alignment->focal_ratio));
  }
  const double rows = rig.rows.systematic_rms();
  if (rows > kHarmlessRows) {
    reasons.push_back(fmt::format("rows are {:.2f} px off by place in the image", rows));
  }
}

std::string text_of(const std::optional<FoundParameter>& found, const char* unit) {
  if (!found) return "nothing";
  return fmt::format("{:.3f} +- {:.3f}{}", found->value,
                     std::hypot(found->sigma, found->systematic), unit);
}

std::string text_of(const std::optional<PairAlignment>& rows) {
  return rows ? fmt::format("{:.2f} px", rows->row_rms) : "nothing";
}

// What the run has found wins.
std::vector<std::string> changes_of(const RigFindings& rig) {
  std::vector<std::string> changes;
  const RigCorrection& before = rig.of_map;
  if (rig.changed.rows) {
    changes.push_back(fmt::format("rows are off by {} now, by {} when the map was made",
                                  text_of(rig.alignment), text_of(before.rows)));
  }
  if (rig.changed.disparity) {
    changes.push_back(fmt::format("disparities are off by {} now, by {} when the map was made",
                                  text_of(rig.disparity, " px"), text_of(before.disparity, " px")));
  }
  if (rig.changed.shading) {
    changes.push_back(fmt::format("the shading depth is {} now, {} when the map was made",
                                  text_of(rig.shading, ""), text_of(before.shading, "")));
  }
  return changes;
}

// Where an offset is in use it is no accident: DisparityCalibrator sees to that.
void judge_disparities(const RigFindings& rig, std::vector<std::string>& reasons) {
  if (!(rig.median_disparity > 0)) return;
  const double scale = std::abs(rig.disparity_offset) / rig.median_disparity;
  if (scale <= kDoubtfulScale) return;
  reasons.push_back(fmt::format("disparities are {:.2f} px off, {:.1f} % of the scale (taken out)",
                                rig.disparity_offset, 100 * scale));
}

void judge_lens(const MapSnapshot& map, CalibrationFigures& figures) {
  for (std::uint32_t i = 0; i < map.camera_count(); ++i) {
    if (!(baseline(map.camera(CameraId(i))) > 0)) continue;
    figures.lens = find_lens_error(map, CameraId(i), FloorFinder::kMost);
  }
  if (!figures.lens || !figures.lens->is_shown()) return;
  const LensError& lens = *figures.lens;
  figures.reasons.push_back(
      fmt::format("lenses distort by {:+.2f} +- {:.2f} % more at the corner than calibrated, which "
                  "makes the way "
                  "{:.1f} % too {}",
                  100 * lens.corner, 100 * std::abs(lens.corner * lens.sigma / lens.distortion),
                  100 * std::abs(lens.scale - 1), lens.scale > 1 ? "long" : "short"));
}

void judge_residuals(const MapSnapshot& map, CalibrationFigures& figures) {
  for (std::size_t i = 0; i < figures.maps.size(); ++i) {
    const SystematicPart& part = figures.systematic[i];
    const double off = std::max(part.image_rms, part.disparity_rms);
    if (off <= kSystematic) continue;
    const bool stereo = baseline(map.camera(figures.maps[i].camera)) > 0;
    figures.reasons.push_back(fmt::format("{}: residuals are {:.2f} px off by place in the image",
                                          stereo ? "stereo" : "fisheye", off));
  }
}

std::string field(double value) {
  return std::isfinite(value) ? fmt::format(",{:.5f}", value) : std::string(",");
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json to_json(const std::optional<FoundParameter>& found) {
  if (!found) return {};
  return {{"value", found->value},
          {"sigma", std::hypot(found->sigma, found->systematic)},
          {"in_use", found->in_use}};
}

}  // namespace

CalibrationFigures calibration_figures(const MapSnapshot& map, const RigFindings* rig) {
  CalibrationFigures figures;
  for (std::uint32_t i = 0; i < map.camera_count(); ++i) {
    figures.maps.push_back(residual_map(map, CameraId(i), std::numeric_limits<std::size_t>::max()));
    figures.systematic.push_back(systematic_part(figures.maps.back()));
  }
  if (rig != nullptr) {
    figures.rig = *rig;
    figures.stereo = true;
    figures.changes = changes_of(*rig);
    judge_rows(*rig, figures.reasons);
    judge_disparities(*rig, figures.reasons);
  }
  judge_residuals(map, figures);
  judge_lens(map, figures);
  return figures;
}

Json to_json(const CalibrationFigures& figures) {
  Json json;
  json["doubtful"] = !figures.reasons.empty();
  json["reasons"] = figures.reasons;
  json["changes"] = figures.changes;
  if (figures.stereo) {
    const RigFindings& rig = figures.rig;
    if (rig.alignment) {
      json["taken_out"] = {{"pitch_deg", kDegrees * rig.alignment->pitch},
                           {"roll_deg", kDegrees * rig.alignment->roll},
                           {"focal_ratio", 1 + rig.alignment->focal_ratio},
                           {"rows_px", rig.alignment->row_rms},
                           {"row_sigma_px", rig.alignment->row_sigma}};
    } else {
      json["taken_out"] = Json();
    }
    json["rows_px"] = rig.rows.systematic_rms();
    json["disparity_offset_px"] = rig.disparity_offset;
    json["disparity_offset_sigma_px"] = number(rig.disparity_sigma);
    json["median_disparity_px"] = rig.median_disparity;
    json["disparity"] = to_json(rig.disparity);
    json["shading"] = to_json(rig.shading);
    json["of_map"] = {{"rows_px", rig.of_map.rows ? Json(rig.of_map.rows->row_rms) : Json()},
                      {"disparity", to_json(rig.of_map.disparity)},
                      {"shading", to_json(rig.of_map.shading)}};
  }
  if (const auto& lens = figures.lens) {
    json["lens"] = {{"distortion", lens->distortion},
                    {"sigma", lens->sigma},
                    {"corner", lens->corner},
                    {"scale", lens->scale}};
  } else {
    json["lens"] = Json();
  }
  Json& systematic = json["systematic_px"] = Json::array();
  for (const SystematicPart& part : figures.systematic) {
    systematic.push_back({{"image", part.image_rms},
                          {"disparity", part.disparity_rms},
                          {"significance", part.significance}});
  }
  return json;
}

void write_calibration(const std::filesystem::path& path, const MapSnapshot& map,
                       const CalibrationFigures& figures) {
  std::string text =
      "camera,column,row,u_px,v_px,count,mean_u_px,mean_v_px,mean_disparity_px,mean_row_px,"
      "sigma_u_px,sigma_v_px,sigma_disparity_px,sigma_row_px,floor_px,floor_disparity_px\n";
  for (std::size_t i = 0; i < figures.maps.size(); ++i) {
    const ResidualMap& residuals = figures.maps[i];
    const bool stereo = baseline(map.camera(residuals.camera)) > 0;
    for (std::size_t cell = 0; cell < residuals.cells.size(); ++cell) {
      const Moments u = residuals.all(cell, MeasuredBy::kU);
      const Moments v = residuals.all(cell, MeasuredBy::kV);
      const Moments disparity = residuals.all(cell, MeasuredBy::kDisparity);
      const Moments rows = stereo && figures.stereo ? figures.rig.rows.at(cell) : Moments();
      text += fmt::format("{},{},{},{:.1f},{:.1f},{:.0f}", stereo ? "stereo" : "fisheye",
                          cell % ImageCells::kColumns, cell / ImageCells::kColumns,
                          residuals.cells.center_x(cell), residuals.cells.center_y(cell), u.count);
      for (const Moments& one : {u, v, disparity, rows}) {
        text += one.count > 0 ? field(one.mean()) : std::string(",");
      }
      for (const Moments& one : {u, v, disparity, rows}) {
        text += one.count > 1 ? field(std::sqrt(one.variance())) : std::string(",");
      }
      text += field(std::sqrt(figures.systematic[i].image[cell])) +
              (stereo ? field(std::sqrt(figures.systematic[i].disparity[cell])) : ",") + "\n";
    }
  }
  write_file(path, text);
}

}  // namespace hybrid_slam
