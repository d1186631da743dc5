#include "apps/feature_eval/study/study_charts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <vector>

#include <fmt/format.h>

#include "apps/feature_eval/study/error_curve.h"

namespace hybrid_slam {
namespace {

constexpr double kWidth = 460, kHeight = 300;  // of a chart [px], its axes' words included
constexpr double kLeft = 46, kRight = 24, kTop = 20, kBottom = 40;

constexpr std::array kDashes{"none", "7 3", "2 3", "9 3 2 3"};
constexpr std::size_t kColours = 8;  // in the page's style

double across(double share) { return kLeft + (kWidth - kLeft - kRight) * share; }
double up(double share) { return kHeight - kBottom - (kHeight - kTop - kBottom) * share; }

void add_line(std::string& svg, double x1, double y1, double x2, double y2) {
  fmt::format_to(std::back_inserter(svg),
                 R"(<line class="grid" x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}"/>)", x1, y1,
                 x2, y2);
}

void add_text(std::string& svg, double x, double y, const char* anchor, const std::string& text) {
  fmt::format_to(std::back_inserter(svg),
                 R"(<text x="{:.1f}" y="{:.1f}" text-anchor="{}">{}</text>)", x, y, anchor,
                 html_text(text));
}

std::string begin_chart(const std::string& label) {
  std::string svg =
      fmt::format(R"(<svg class="chart" viewBox="0 0 {} {}" role="img" aria-label="{}">)", kWidth,
                  kHeight, html_text(label));
  for (int tenths = 0; tenths <= 10; tenths += 2) {
    add_line(svg, across(0), up(tenths / 10.0), across(1), up(tenths / 10.0));
    add_text(svg, kLeft - 6, up(tenths / 10.0) + 4, "end", fmt::format("{:.1f}", tenths / 10.0));
  }
  return svg;
}

double degrees_across(double degrees) { return across(std::sqrt(degrees / kLargestError)); }

std::vector<double> errors_of_kind(const MethodResult& method, StudyModel model, ErrorKind kind) {
  std::vector<double> errors;
  for (const PairResult& pair : method.pairs) {
    const MotionErrors& motion = pair.motion[static_cast<std::size_t>(model)];
    errors.push_back(kind == ErrorKind::kRotation ? motion.rotation_deg : motion.direction_deg);
  }
  return errors;
}

// Milliseconds of a pair and mean AUC of its translation, over all sequences.
struct SpeedAndQuality {
  double milliseconds = 0;
  double auc = 0;
};

SpeedAndQuality speed_and_quality(const Study& study, std::size_t method) {
  SpeedAndQuality mean;
  const auto count = static_cast<double>(study.sequences.size());
  for (const SequenceResult& sequence : study.sequences) {
    const StudyScores s = scores_of(sequence.methods[method], StudyModel::kPlane);
    mean.milliseconds += (2 * s.ms_per_image + s.ms_per_match) / count;
    mean.auc += s.auc_translation / count;
  }
  return mean;
}

}  // namespace

std::string html_text(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '&':
        safe += "&amp;";
        break;
      case '"':
        safe += "&quot;";
        break;
      default:
        safe += c;
    }
  }
  return safe;
}

namespace {

// Where names stand beside their marks: below one another where marks are close together.
class Labels {
 public:
  // The height of the next one's text.
  double place(double x, double y) {
    constexpr double kWide = 75, kHigh = 12;
    double at = y - 3;
    for (bool moved = true; moved;) {
      moved = false;
      for (const auto& [other_x, other_at] : taken_) {
        if (std::abs(other_x - x) >= kWide || std::abs(other_at - at) >= kHigh) continue;
        at = other_at + kHigh;
        moved = true;
      }
    }
    taken_.emplace_back(x, at);
    return at;
  }

 private:
  std::vector<std::pair<double, double>> taken_;
};

}  // namespace

std::string line_style(std::size_t method) {
  return fmt::format(R"(class="m m{}" stroke-dasharray="{}")", method % kColours,
                     kDashes[method % kDashes.size()]);
}

std::string chart_key(const SequenceResult& sequence) {
  std::string key = R"(<p class="key">)";
  for (std::size_t i = 0; i < sequence.methods.size(); ++i) {
    fmt::format_to(std::back_inserter(key),
                   R"(<span><svg width="30" height="8"><path {} d="M0 4H30"/></svg> {}</span> )",
                   line_style(i), html_text(sequence.methods[i].name));
  }
  return key + "</p>\n";
}

std::string curve_chart(const SequenceResult& sequence, StudyModel model, ErrorKind kind) {
  const bool rotation = kind == ErrorKind::kRotation;
  const std::string what =
      rotation ? "error of the rotation" : "error of the translation's direction";
  std::string svg = begin_chart(sequence.name + ": share of the pairs by the " + what);
  for (const int degrees : {0, 1, 5, 10, 20, 45, 90, 180}) {
    add_line(svg, degrees_across(degrees), up(0), degrees_across(degrees), up(1));
    add_text(svg, degrees_across(degrees), up(0) + 15, "middle", std::to_string(degrees));
  }
  add_text(svg, across(0.5), kHeight - 6, "middle", what + " [deg]");
  for (std::size_t i = 0; i < sequence.methods.size(); ++i) {
    std::string path;
    for (const auto& [degrees, share] :
         error_curve(errors_of_kind(sequence.methods[i], model, kind))) {
      fmt::format_to(std::back_inserter(path), "{}{:.1f} {:.1f}", path.empty() ? "M" : "L",
                     degrees_across(degrees), up(share));
    }
    fmt::format_to(std::back_inserter(svg), R"(<path {} d="{}"><title>{}</title></path>)",
                   line_style(i), path, html_text(sequence.methods[i].name));
  }
  return svg + "</svg>\n";
}

std::string speed_chart(const Study& study) {
  constexpr double kLeast = 1, kMost = 10000;  // [ms]
  const auto time_across = [&](double milliseconds) {
    return across(std::log(std::clamp(milliseconds, kLeast, kMost) / kLeast) /
                  std::log(kMost / kLeast));
  };
  std::string svg = begin_chart("AUC of the translation against the time of a pair");
  Labels labels;
  for (double time = kLeast; time <= kMost; time *= 10) {
    add_line(svg, time_across(time), up(0), time_across(time), up(1));
    add_text(svg, time_across(time), up(0) + 15, "middle", fmt::format("{:.0f}", time));
  }
  add_text(svg, across(0.5), kHeight - 6, "middle", "time of a pair: two images, one match [ms]");
  for (std::size_t i = 0; i < study.sequences.front().methods.size(); ++i) {
    const auto [milliseconds, auc] = speed_and_quality(study, i);
    const std::string& name = study.sequences.front().methods[i].name;
    fmt::format_to(
        std::back_inserter(svg),
        R"(<circle {} cx="{:.1f}" cy="{:.1f}" r="4"><title>{}: {:.1f} ms, {:.3f}</title></circle>)",
        line_style(i), time_across(milliseconds), up(auc), html_text(name), milliseconds, auc);
    add_text(svg, time_across(milliseconds) + 7, labels.place(time_across(milliseconds), up(auc)),
             "start", name);
  }
  return svg + "</svg>\n";
}

}  // namespace hybrid_slam
