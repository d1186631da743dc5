#include "apps/dataset_check/check_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kShown = 5;  // of lists, in the text

// [deg], of a pinhole
double field_of_view(int size, double focal) {
  return 2 * std::atan(0.5 * size / focal) * 180 / std::numbers::pi;
}

// At a disparity of so many pixels [m]; none at infinity and behind.
std::optional<double> distance(const DatasetCheck& check, double disparity) {
  if (!(disparity > 0)) return std::nullopt;
  return check.info.stereo.params[0] * check.info.stereo.params[4] / disparity;
}

std::string metres(std::optional<double> distance) {
  return distance ? fmt::format("{:.3g} m", *distance) : "infinity";
}

std::string causes_text(const ImageSurvey& images) {
  std::string text;
  for (const auto& [name, count] : images.causes) text += fmt::format(", {} {}", name, count);
  return text.empty() ? ", nothing odd" : text;
}

std::string images_text(const char* title, const ImageSurvey& images) {
  return fmt::format(
      "{:<12}brightness {:.0f} of 255, blur {:.2f} (0.3 is sharp, 0.7 a blur of 15 px), medians of "
      "{}{}\n",
      title, images.brightness, images.blur, images.images, causes_text(images));
}

std::string rows_text(const PairSurvey& pairs) {
  const RowAgreement rows = pairs.rows();
  std::string text = fmt::format(
      "{:<12}left and right differ by {:.2f} px (median of {} matches; about 0.3 in good pairs), "
      "left less right {:+.2f} px\n",
      "rows", rows.error, rows.matches, rows.offset);
  for (int r = 0; r < PairSurvey::kGrid; ++r) {
    text += fmt::format("{:<12}", r == 0 ? "  by region" : "");
    for (int c = 0; c < PairSurvey::kGrid; ++c) {
      const RowAgreement region = pairs.rows_in(c, r);
      text += region.matches == 0 ? fmt::format("{:>18}", "-")
                                  : fmt::format("{:>10.2f} ({:+.2f})", region.error, region.offset);
    }
    text += "\n";
  }
  return text;
}

std::string scale_text(const DatasetCheck& check) {
  const PairSurvey& pairs = check.pairs;
  if (pairs.matches() == 0) return fmt::format("{:<12}not known: no matches\n", "distances");
  const double near = pairs.disparity(95), middle = pairs.disparity(50), far = pairs.disparity(5);
  std::string text =
      fmt::format("{:<12}near {}, median {}, far {} (disparities {:.1f}, {:.1f}, {:.1f} px)",
                  "distances", metres(distance(check, near)), metres(distance(check, middle)),
                  metres(distance(check, far)), near, middle, far);
  if (middle > 0) {
    text += fmt::format("; one pixel is {:.1f} % of the median", 100 / middle);
  }
  return text + "\n";
}

std::string frames_text(const char* title, const std::vector<NamedFrame>& frames) {
  std::string text;
  for (std::size_t i = 0; i < std::min(frames.size(), kShown); ++i) {
    const NamedFrame& frame = frames[i];
    text += fmt::format("{:<12}frame {}: {}\n", i == 0 ? title : "", frame.frame,
                        frame.text.empty() ? fmt::format("{:.3f} s", frame.value) : frame.text);
  }
  if (frames.size() > kShown)
    text += fmt::format("{:<12}and {} more\n", "", frames.size() - kShown);
  return text;
}

std::string list_text(const char* title, const std::vector<std::string>& lines) {
  std::string text;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    text += fmt::format("{:<12}{}\n", i == 0 ? title : "", lines[i]);
  }
  return text;
}

std::string features_text(const DatasetCheck& check) {
  const FeatureSurvey& stereo = check.stereo_features;
  std::string text =
      fmt::format("{:<12}{:.0f} in an image, {:.0f} % of them matched, medians of {} pairs",
                  "features", stereo.features, 100 * stereo.matched, stereo.frames);
  if (check.fisheye_features.frames > 0) {
    text += fmt::format("; {:.0f} in a fisheye image", check.fisheye_features.features);
  }
  return text + "\n";
}

Json rows_json(const RowAgreement& rows) {
  if (rows.matches == 0) return {{"matches", 0}, {"error_px", Json()}, {"offset_px", Json()}};
  return {{"matches", rows.matches}, {"error_px", rows.error}, {"offset_px", rows.offset}};
}

Json images_json(const ImageSurvey& images, const FeatureSurvey& features) {
  return {{"images", images.images},
          {"brightness", images.brightness},
          {"blur", images.blur},
          {"causes", images.causes.empty() ? Json::object() : Json(images.causes)},
          {"sampled", features.frames},
          {"features", features.features}};
}

Json scale_json(const DatasetCheck& check) {
  const auto at = [&](double percent) {
    const double disparity = check.pairs.disparity(percent);
    const auto metres = distance(check, disparity);
    return Json{{"disparity_px", disparity}, {"distance_m", metres ? Json(*metres) : Json()}};
  };
  if (check.pairs.matches() == 0) return {};
  return {{"near", at(95)}, {"median", at(50)}, {"far", at(5)}};
}

Json regions_json(const PairSurvey& pairs) {
  Json regions = Json::array();
  for (int r = 0; r < PairSurvey::kGrid; ++r) {
    Json row = Json::array();
    for (int c = 0; c < PairSurvey::kGrid; ++c) row.push_back(rows_json(pairs.rows_in(c, r)));
    regions.push_back(std::move(row));
  }
  return regions;
}

}  // namespace

std::string to_text(const DatasetCheck& check) {
  const SequenceInfo& info = check.info;
  const auto& [fx, fy, cx, cy, baseline] = info.stereo.params;
  std::string text = fmt::format(
      "{:<12}{} ({}): {} stereo pairs of {}x{}{}\n", "dataset", info.name, info.layout,
      info.times.size(), info.stereo.width, info.stereo.height,
      info.fisheye ? fmt::format(", fisheye of {}x{}", info.fisheye->width, info.fisheye->height)
                   : "");
  text += fmt::format(
      "{:<12}focal length {:.2f} px, view of {:.0f} by {:.0f} degrees, baseline {:.4g} m\n",
      "camera", fx, field_of_view(info.stereo.width, fx), field_of_view(info.stereo.height, fy),
      baseline);
  text += fmt::format(
      "{:<12}{:.3f} s; a frame every {:.4g} s ({:.4g} Hz), from {:.4g} to {:.4g} s\n", "times",
      check.rate.duration, check.rate.period, check.rate.period > 0 ? 1 / check.rate.period : 0,
      check.rate.shortest, check.rate.longest);
  text += frames_text("gaps", check.gaps);
  text += frames_text("unreadable", check.unreadable);
  text += images_text("images", check.stereo);
  if (check.fisheye.images > 0) text += images_text("fisheye", check.fisheye);
  text += features_text(check);
  text += rows_text(check.pairs);
  text += scale_text(check);
  text += list_text("missing", check.missing);
  text += list_text("opening", info.warnings);
  std::vector<std::string> findings;
  for (const Finding& finding : check.findings) findings.push_back(finding.text);
  if (findings.empty()) findings.emplace_back("nothing that speaks against it");
  text += list_text("found", findings);
  if (check.cancelled)
    text += fmt::format("{:<12}this is of the frames up to then\n", "interrupted");
  return text;
}

Json to_json(const DatasetCheck& check) {
  const SequenceInfo& info = check.info;
  Json json;
  json["sequence"] = info.name;
  json["layout"] = info.layout;
  json["pairs"] = info.times.size();
  json["width"] = info.stereo.width;
  json["height"] = info.stereo.height;
  json["focal_length_px"] = info.stereo.params[0];
  json["baseline_m"] = info.stereo.params[4];
  json["times"] = {{"duration_s", check.rate.duration},
                   {"period_s", check.rate.period},
                   {"shortest_s", check.rate.shortest},
                   {"longest_s", check.rate.longest}};
  json["gaps"] = Json::array();
  for (const NamedFrame& gap : check.gaps) {
    json["gaps"].push_back({{"frame", gap.frame}, {"seconds", gap.value}});
  }
  json["unreadable"] = Json::array();
  for (const NamedFrame& frame : check.unreadable) {
    json["unreadable"].push_back({{"frame", frame.frame}, {"reason", frame.text}});
  }
  json["stereo"] = images_json(check.stereo, check.stereo_features);
  json["stereo"]["matched"] = check.stereo_features.matched;
  json["fisheye"] = Json();
  if (info.fisheye) {
    json["fisheye"] = images_json(check.fisheye, check.fisheye_features);
    json["fisheye"]["missing"] = check.fisheye_missing;
  }
  json["rows"] = rows_json(check.pairs.rows());
  json["rows"]["regions"] = regions_json(check.pairs);
  json["reversed"] = check.pairs.reversed();
  json["distances"] = scale_json(check);
  json["missing"] = check.missing;
  json["opening"] = info.warnings;
  json["findings"] = Json::array();
  for (const Finding& finding : check.findings) {
    json["findings"].push_back({{"name", finding.name}, {"text", finding.text}});
  }
  json["interrupted"] = check.cancelled;
  return json;
}

}  // namespace hybrid_slam
