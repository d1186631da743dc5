#include "apps/report/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

int count_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<int>() : 0;
}

// Of the key a.b.c; NaN where it is no number.
double number_at(const Json& json, std::initializer_list<const char*> path) {
  const Json* at = &json;
  for (const char* key : path) {
    if (!at->is_object() || !at->contains(key)) return kUnknown;
    at = &at->at(key);
  }
  return at->is_number() ? at->get<double>() : kUnknown;
}

std::string millimetres(double metres) {
  return metres < 1 ? fmt::format("{:.3g} mm", 1e3 * metres) : fmt::format("{:.4g} m", metres);
}

// The reasons, one by one.
class Reasons {
 public:
  Reasons(const Json& summary, const RunStory& story, const MapFigures& figures)
      : summary_(summary), story_(story), figures_(figures) {}

  Json list() {
    add_accuracy();
    add_losses();
    add_residuals();
    add_calibration();
    add_ground();
    add_time();
    return std::move(reasons_);
  }

 private:
  // good: true, false, or null where it is neither.
  void add(const char* kind, const std::string& text, const Json& good = Json()) {
    reasons_.push_back({{"kind", kind}, {"text", text}, {"good", good}});
  }

  void add_accuracy() {
    const double rmse = number_at(summary_, {"ate", "position_m", "rmse"});
    if (std::isfinite(rmse)) {
      add("accuracy",
          fmt::format("{} RMSE from the truth over {:.4g} m of way (SE3 alignment){}",
                      millimetres(rmse), number_at(summary_, {"ate", "true_length_m"}),
                      count_at(summary_, "components") > 1 ? ", of the largest part alone" : ""));
      const double arm =
          number_at(summary_, {"fisheye", "relative_pose_error", "translation_m", "median"});
      if (std::isfinite(arm)) {
        add("accuracy", fmt::format("fisheye in the left camera: {} from the truth (median)",
                                    millimetres(arm)));
      }
      return;
    }
    // Without frames that begin a part: theirs is how uncertain its place against the others is.
    std::vector<double> sigmas;
    for (const RunFrame& frame : story_.frames) {
      const bool begins = frame.state == "starting";
      if (frame.stereo && !begins && std::isfinite(frame.sigma_position)) {
        sigmas.push_back(frame.sigma_position);
      }
    }
    if (sigmas.empty()) return;
    std::sort(sigmas.begin(), sigmas.end());
    add("accuracy",
        fmt::format("no truth to compare with; by its own estimate the position is uncertain by {} "
                    "(1 sigma, median), {} at worst",
                    millimetres(sigmas[sigmas.size() / 2]), millimetres(sigmas.back())));
  }

  void add_losses() {
    for (const bool stereo : {true, false}) {
      std::size_t stretches = 0, frames = 0, longest = 0;
      std::string cause;
      for (const LostStretch& loss : story_.losses) {
        if (story_.frames[loss.first].stereo != stereo) continue;
        ++stretches;
        frames += loss.frames;
        if (loss.frames > longest) cause = loss.cause;
        longest = std::max(longest, loss.frames);
      }
      if (stretches == 0) continue;
      add("lost",
          fmt::format("{}: {} frames without a pose, in {} stretch{}; the longest, of {}: {}",
                      stereo ? "stereo" : "fisheye", frames, stretches, stretches > 1 ? "es" : "",
                      longest, cause),
          false);
    }
    if (story_.losses.empty() && !story_.frames.empty()) {
      add("lost",
          dropped_frames() > 0 ? "never lost: every frame that was not dropped has a pose"
                               : "never lost: every frame of every camera has a pose",
          true);
    }
  }

  void add_residuals() {
    for (const CameraResiduals& camera : figures_.cameras) {
      if (camera.observations == 0) continue;
      add("residuals",
          fmt::format("{}: residuals of {:.2f} px RMS, {:.2f} of what was assumed",
                      camera.stereo ? "stereo" : "fisheye", camera.rms_px, camera.rms_sigmas));
    }
  }

  void add_calibration() {
    if (!summary_.contains("causes")) return;
    const int doubtful = count_at(summary_.at("causes"), "calibration_doubtful");
    if (doubtful > 0) {
      add("calibration", fmt::format("calibration doubtful in {} frames", doubtful), false);
    }
    const Json found = summary_.value("calibration", Json::object());
    const Json wrong = found.value("reasons", Json::array());
    for (const Json& reason : wrong) {
      if (!reason.is_string()) continue;
      add("calibration", "the rig should be calibrated again: " + reason.get<std::string>(), false);
    }
    if (doubtful > 0 || !wrong.empty()) return;
    const double rows = number_at(found, {"rows_px"});
    const double sigma = number_at(found, {"disparity_offset_sigma_px"});
    add("calibration",
        fmt::format(
            "calibration: nothing speaks against it{}; disparities off by {:.2f} px{}",
            std::isfinite(rows) ? fmt::format("; rows off by {:.2f} px by place", rows) : "",
            number_at(summary_, {"disparity_offset_px"}),
            std::isfinite(sigma) ? fmt::format(", 1 sigma {:.2f} px", sigma) : ""),
        true);
  }

  void add_ground() {
    const double once = number_at(summary_, {"coverage", "seen_once_share"});
    if (!std::isfinite(once)) return;
    const double sigma = number_at(summary_, {"landmark_sigma_mm", "median"});
    const double weak = number_at(summary_, {"landmark_sigma_mm", "p95"});
    add("ground",
        fmt::format("{:.1f} % of the ground that was seen was seen by one keyframe only{}",
                    100 * once,
                    std::isfinite(sigma)
                        ? fmt::format("; landmarks are uncertain by {:.3g} mm (median), one in "
                                      "twenty by more than {:.3g} mm",
                                      sigma, weak)
                        : ""));
  }

  void add_time() {
    const double seconds = number_at(summary_, {"seconds"});
    if (!(seconds > 0) || !(story_.span > 0)) return;
    const int dropped = dropped_frames();
    const Json options = summary_.value("options", Json::object());
    if (options.value("mode", "") == "realtime") return add_realtime(options, dropped);
    add("time",
        fmt::format("{:.4g} s for {:.4g} s of images: {}{}", seconds, story_.span,
                    seconds <= story_.span ? "faster than the cameras" : "slower than the cameras",
                    dropped > 0 ? fmt::format("; {} frames dropped", dropped) : ""),
        seconds <= story_.span && dropped == 0);
  }

  // Of both cameras.
  int dropped_frames() const {
    if (!summary_.is_object()) return 0;
    const Json fisheye = summary_.value("fisheye", Json::object());
    return count_at(summary_.value("frames", Json::object()), "dropped") +
           count_at(fisheye.value("frames", Json::object()), "dropped");
  }

  // Images come by the clock then, and what is too much for the machine is dropped.
  void add_realtime(const Json& options, int dropped) {
    const double rate = number_at(options, {"rate"});
    const double behind = number_at(summary_, {"behind_ms", "p95"});
    std::string text = "realtime";
    if (rate > 0) text += fmt::format(" at {:.3g} Hz", rate);
    if (rate > 0 && std::isfinite(story_.period)) {
      text += fmt::format(", the images are of {:.3g} Hz", 1 / story_.period);
    }
    text += fmt::format(": {} frames dropped", dropped);
    if (std::isfinite(behind)) {
      text += fmt::format("; 95 % of the poses came within {:.0f} ms", behind);
    }
    add("time", text, dropped == 0);
  }

  const Json& summary_;
  const RunStory& story_;
  const MapFigures& figures_;
  Json reasons_ = Json::array();
};

}  // namespace

Json verdict(const Json& summary, const RunStory& story, const MapFigures& figures) {
  std::string level = "unknown", text = "A map; the run that made it is not known.";
  if (summary.is_object() && summary.contains("frames")) {
    const Json& frames = summary.at("frames");
    const int read = count_at(frames, "read"), tracked = count_at(frames, "tracked");
    const int components = count_at(summary, "components");
    const bool errors =
        summary.contains("internal_errors") && !summary.at("internal_errors").empty();
    level = tracked == 0 ? "nothing" : components > 1 ? "parts" : tracked < read ? "gaps" : "whole";
    const std::string poses = fmt::format("{} of {} frames have a pose", tracked, read);
    text = level == "nothing" ? fmt::format("No frame of {} could be tracked.", read)
           : level == "parts"
               ? fmt::format(
                     "In {} parts: {} in the largest; where the parts lie against one "
                     "another is not known.",
                     components, poses)
           : level == "gaps" ? fmt::format("With gaps: {} in one map.", poses)
                             : fmt::format("Whole: {} in one map.", poses);
    if (errors) text += " An internal error happened: see internal_errors.";
  }
  return {{"level", level}, {"text", text}, {"reasons", Reasons(summary, story, figures).list()}};
}

}  // namespace hybrid_slam
