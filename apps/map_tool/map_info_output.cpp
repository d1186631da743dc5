#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <numbers>
#include <numeric>

#include "apps/map_tool/map_info.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kDegrees = 180 / std::numbers::pi;

std::vector<std::string> parameters_of(std::string_view model) {
  if (model == Pinhole::kName) return {"fx", "fy", "cx", "cy"};
  if (model == RectifiedStereo::kName) return {"fx", "fy", "cx", "cy", "baseline"};
  if (model == KannalaBrandt::kName) return {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};
  if (model == Radial::kName) return {"f", "cx", "cy", "k1", "k2"};
  if (model == Bal::kName) return {"f", "k1", "k2"};
  return {};
}

std::span<const double> values_of(const Camera& camera) {
  return std::visit([](const auto& one) { return std::span<const double>(one.params); }, camera);
}

// Text that grows.
class Lines {
 public:
  template <typename... Args>
  void add(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Args>(args)...);
    text_.push_back('\n');
  }
  std::string text() const { return {text_.data(), text_.size()}; }

 private:
  fmt::memory_buffer text_;
};

std::string span_text(const TimeSpan& span) {
  return fmt::format("{:.3f} to {:.3f} s ({:.1f} s)", span.first, span.last,
                     span.last - span.first);
}

void add_camera(std::size_t id, const MapCameraInfo& info, Lines& lines) {
  lines.add("camera {}    {} {}x{}", id, model_name(info.camera), image_width(info.camera),
            image_height(info.camera));
  std::string numbers;
  const std::vector<std::string> names = parameter_names(info.camera);
  for (std::size_t i = 0; i < names.size(); ++i) {
    numbers += fmt::format("{}{} {:.6g}", i == 0 ? "" : ", ", names[i], values_of(info.camera)[i]);
  }
  lines.add("  calibration {}", numbers);
  for (const std::string& line : correction_lines(info.correction)) {
    lines.add("  found       {}", line);
  }
  if (info.keyframes == 0) return;
  lines.add("  keyframes   {}, {}", info.keyframes, span_text(info.time));
  lines.add("  sees        {} landmarks by {} observations; {} features in the map", info.landmarks,
            info.residuals.observations + info.residuals.behind, info.features);
  lines.add(
      "  residuals   rms {:.3f} px; in standard deviations rms {:.3f} (noise as assumed: 1), "
      "median {:.3f} (0.674)",
      info.residuals.rms_pixels, info.residuals.rms, info.residuals.median);
  if (info.residuals.behind > 0) lines.add("  behind it   {} observations", info.residuals.behind);
}

void add_component(const MapComponentInfo& info, Lines& lines) {
  std::string keyframes;
  for (std::size_t i = 0; i < info.keyframes.size(); ++i) {
    keyframes += fmt::format("{}{} of camera {}", i == 0 ? "" : ", ", info.keyframes[i], i);
  }
  lines.add("component {}", info.name.value);
  lines.add("  keyframes   {}", keyframes);
  lines.add("  time        {}", span_text(info.time));
  lines.add("  way         {:.2f} m from stereo keyframe to stereo keyframe", info.way);
  lines.add("  landmarks   {}, seen from {:.2f} m (median)", info.landmarks, info.distance);
  lines.add(
      "  area        {:.2f} m2 in cells of {:.3f} m that hold a landmark; convex hull {:.2f} m2, "
      "{:.2f} x {:.2f} m",
      info.area.footprint, info.area.cell, info.area.hull, info.area.length, info.area.width);
}

Json rows_json(const std::optional<PairAlignment>& rows) {
  if (!rows) return {};
  return {{"pitch_deg", kDegrees * rows->pitch},
          {"pitch_sigma_deg", kDegrees * rows->pitch_sigma},
          {"roll_deg", kDegrees * rows->roll},
          {"roll_sigma_deg", kDegrees * rows->roll_sigma},
          {"focal_ratio", 1 + rows->focal_ratio},
          {"focal_ratio_sigma", rows->focal_sigma},
          {"rows_px", rows->row_rms},
          {"row_sigma_px", rows->row_sigma},
          {"matches", rows->matches}};
}

Json parameter_json(const std::optional<FoundParameter>& found) {
  if (!found) return {};
  return {{"value", found->value},
          {"sigma", found->sigma},
          {"systematic", found->systematic},
          {"in_use", found->in_use}};
}

Json correction_json(const RigCorrection& correction) {
  return {{"rows", rows_json(correction.rows)},
          {"disparity_offset_px", parameter_json(correction.disparity)},
          {"shading_depth", parameter_json(correction.shading)}};
}

Json span_json(const TimeSpan& span) { return {{"first_s", span.first}, {"last_s", span.last}}; }

Json camera_json(std::size_t id, const MapCameraInfo& info) {
  Json parameters;
  const std::vector<std::string> names = parameter_names(info.camera);
  for (std::size_t i = 0; i < names.size(); ++i) parameters[names[i]] = values_of(info.camera)[i];
  return {{"id", id},
          {"model", model_name(info.camera)},
          {"width", image_width(info.camera)},
          {"height", image_height(info.camera)},
          {"parameters", parameters},
          {"found", correction_json(info.correction)},
          {"keyframes", info.keyframes},
          {"features", info.features},
          {"landmarks", info.landmarks},
          {"time", span_json(info.time)},
          {"residuals",
           {{"observations", info.residuals.observations},
            {"behind", info.residuals.behind},
            {"rms_px", info.residuals.rms_pixels},
            {"whitened_rms", info.residuals.rms},
            {"whitened_median", info.residuals.median}}}};
}

Json component_json(const MapComponentInfo& info) {
  return {{"name", info.name.value},
          {"keyframes_by_camera", info.keyframes},
          {"landmarks", info.landmarks},
          {"time", span_json(info.time)},
          {"way_m", info.way},
          {"median_distance_m", info.distance},
          {"area",
           {{"footprint_m2", info.area.footprint},
            {"cell_m", info.area.cell},
            {"convex_hull_m2", info.area.hull},
            {"length_m", info.area.length},
            {"width_m", info.area.width}}}};
}

}  // namespace

std::vector<std::string> parameter_names(const Camera& camera) {
  std::vector<std::string> names = parameters_of(model_name(camera));
  for (std::size_t i = names.size(); i < values_of(camera).size(); ++i) {
    names.push_back(fmt::format("p{}", i));
  }
  return names;
}

std::vector<std::string> correction_lines(const RigCorrection& correction) {
  std::vector<std::string> lines;
  if (const auto& rows = correction.rows) {
    lines.push_back(fmt::format(
        "right camera turned by {:.3f} +- {:.3f} deg about x, {:.3f} +- {:.3f} deg about z, focal "
        "length {:+.2f} +- {:.2f} %; taken out of its images",
        kDegrees * rows->pitch, kDegrees * rows->pitch_sigma, kDegrees * rows->roll,
        kDegrees * rows->roll_sigma, 100 * rows->focal_ratio, 100 * rows->focal_sigma));
  }
  const auto add = [&](const char* name, const std::optional<FoundParameter>& found) {
    if (!found) return;
    lines.push_back(fmt::format(
        "{} {:.3f} +- {:.3f}, {}", name, found->value, std::hypot(found->sigma, found->systematic),
        found->in_use == 0 ? "not in use" : fmt::format("{:.3f} in use", found->in_use)));
  };
  add("offset of the disparities [px]", correction.disparity);
  add("shading depth over size", correction.shading);
  return lines;
}

std::string to_text(const MapInfo& info) {
  Lines lines;
  lines.add("made by     {}", info.file.program);
  lines.add("keyframes   {} ({} more were erased)", info.keyframes, info.erased_keyframes);
  lines.add("landmarks   {}, {} observations", info.landmarks, info.observations);
  const MapEdgeInfo& edges = info.edges;
  lines.add(
      "edges       {} share a landmark, {} of these 15 or more, {} of these after the vehicle "
      "was away; odometry {}, loose {}",
      edges.covisible, edges.strong, edges.returns, edges.odometry, edges.loose);
  lines.add("kept        {} keyframes: origin, begins of components, ends of loops", edges.kept);
  for (std::size_t i = 0; i < info.cameras.size(); ++i) add_camera(i, info.cameras[i], lines);
  lines.add("components  {}", info.components.size());
  for (const MapComponentInfo& component : info.components) add_component(component, lines);
  return lines.text();
}

Json to_json(const MapInfo& info) {
  Json json = {{"program", info.file.program},
               {"keyframes", info.keyframes},
               {"erased_keyframes", info.erased_keyframes},
               {"landmarks", info.landmarks},
               {"observations", info.observations},
               {"cameras", Json::array()},
               {"components", Json::array()},
               {"edges",
                {{"covisible", info.edges.covisible},
                 {"strong", info.edges.strong},
                 {"returns", info.edges.returns},
                 {"odometry", info.edges.odometry},
                 {"loose", info.edges.loose},
                 {"kept", info.edges.kept}}},
               {"options", info.file.options}};
  for (std::size_t i = 0; i < info.cameras.size(); ++i) {
    json["cameras"].push_back(camera_json(i, info.cameras[i]));
  }
  for (const MapComponentInfo& one : info.components) {
    json["components"].push_back(component_json(one));
  }
  return json;
}

}  // namespace hybrid_slam
