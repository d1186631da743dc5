#include "apps/feature_eval/study/study_page.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

#include "apps/feature_eval/study/study_charts.h"
#include "apps/slam/version.h"

namespace hybrid_slam {
namespace {

// Colours after Okabe and Ito, which the colour-blind tell apart, as in the report of a run.
constexpr const char* kStyle = R"(
:root { color-scheme: light dark; --paper: #fff; --ink: #1b1f24; --soft: #59636e; --line: #d4d9df;
  --panel: #f5f6f8; --c0: #0072b2; --c1: #d55e00; --c2: #009e73; --c3: #a5447d; --c4: #e69f00;
  --c5: #1b1f24; --c6: #3d8fd1; --c7: #7a6a00; }
@media (prefers-color-scheme: dark) { :root { --paper: #14171b; --ink: #e8eaed; --soft: #a3acb6;
  --line: #38404a; --panel: #1d2228; --c0: #4da9e0; --c1: #ff7a33; --c2: #1fc498; --c3: #e08fbe;
  --c4: #f0b429; --c5: #e8eaed; --c6: #9ad4f5; --c7: #d9ce5a; } }
body { margin: 0 auto; max-width: 1200px; padding: 1rem; background: var(--paper); color: var(--ink);
  font: 15px/1.45 system-ui, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.4rem; } h2 { font-size: 1.15rem; border-top: 2px solid var(--line);
  padding-top: .4rem; } h3 { font-size: .95rem; margin-bottom: .2rem; }
p { max-width: 75ch; } .soft, figcaption, .key { color: var(--soft); font-size: .88rem; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-size: .88rem; }
th, td { padding: .15rem .8rem .15rem 0; border-bottom: 1px solid var(--line); text-align: right;
  font-variant-numeric: tabular-nums; } th:first-child, td:first-child { text-align: left; }
.charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(320px, 1fr)); gap: 1rem; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(440px, 1fr)); gap: 1rem; }
figure { margin: 0; break-inside: avoid; } svg { max-width: 100%; } svg.hidden { position: absolute; }
.chart { width: 100%; max-width: 560px; } .chart text { fill: var(--soft); font-size: 11px; } .grid { stroke: var(--line); }
.key span { margin-right: 1rem; white-space: nowrap; } .m { fill: none; stroke-width: 2; }
.m0 { stroke: var(--c0); } .m1 { stroke: var(--c1); } .m2 { stroke: var(--c2); }
.m3 { stroke: var(--c3); } .m4 { stroke: var(--c4); } .m5 { stroke: var(--c5); }
.m6 { stroke: var(--c6); } .m7 { stroke: var(--c7); } circle.m { fill: var(--paper);
  stroke-dasharray: none; }
.in { stroke: #1fc498; } .out { stroke: #ff7a33; stroke-dasharray: 2 4; } b { font-weight: 700; }
)";

using Figure = double StudyScores::*;

struct Column {
  const char* head;
  Figure figure;
  int digits;
  bool low_is_good;
};
constexpr Column kTable[] = {{"AUC rotation", &StudyScores::auc_rotation, 4, false},
                             {"AUC translation", &StudyScores::auc_translation, 4, false},
                             {"mean inliers", &StudyScores::mean_inliers, 1, false},
                             {"ms per image", &StudyScores::ms_per_image, 2, true},
                             {"ms per match", &StudyScores::ms_per_match, 2, true}};

std::string score_table(const SequenceResult& sequence, StudyModel model) {
  std::string html = "<div class=\"wide\"><table><tr><th>method</th>";
  for (const Column& column : kTable) html += fmt::format("<th>{}</th>", column.head);
  html += "</tr>\n";
  for (const MethodResult& method : sequence.methods) {
    html += "<tr><td>" + html_text(method.name) + "</td>";
    const StudyScores scores = scores_of(method, model);
    for (const Column& column : kTable) {
      const double value = scores.*column.figure;
      const bool best = std::all_of(sequence.methods.begin(), sequence.methods.end(),
                                    [&](const MethodResult& other) {
                                      const double theirs = scores_of(other, model).*column.figure;
                                      return column.low_is_good ? value <= theirs : value >= theirs;
                                    });
      html += fmt::format(fmt::runtime(best ? "<td><b>{:.{}f}</b></td>" : "<td>{:.{}f}</td>"),
                          value, column.digits);
    }
    html += "</tr>\n";
  }
  return html + "</table></div>\n";
}

std::string figure(const std::string& chart, const std::string& caption) {
  return "<figure>" + chart + "<figcaption>" + html_text(caption) + "</figcaption></figure>\n";
}

std::string model_section(const Study& study, StudyModel model, const char* title) {
  std::string html = fmt::format("<h2>{}</h2>\n", title);
  for (const SequenceResult& sequence : study.sequences) {
    html += fmt::format("<h3>{}: {} pairs</h3>\n", html_text(sequence.name),
                        sequence.methods.front().pairs.size());
    html += score_table(sequence, model) + chart_key(sequence) + "<div class=\"charts\">";
    html += figure(curve_chart(sequence, model, ErrorKind::kRotation),
                   "share of the pairs with at most this error of the rotation");
    html += figure(curve_chart(sequence, model, ErrorKind::kDirection),
                   "share of the pairs with at most this error of the translation's direction");
    html += "</div>\n";
  }
  return html;
}

std::string match_section(const Study& study) {
  std::string html =
      "<h2>Matches of one pair</h2>\n<p class=\"soft\">Left camera and fisheye. Green lines: "
      "inliers "
      "of the essential matrix on undistorted coordinates; orange dashes: the other matches. Of "
      "many, evenly some.</p>\n";
  for (std::size_t i = 0; i < study.sequences.size(); ++i) {
    const SequenceResult& sequence = study.sequences[i];
    html += fmt::format("<h3>{}, frame {}</h3>\n", html_text(sequence.name), sequence.shown_frame);
    html += shown_images(sequence, i) + "<div class=\"pictures\">";
    for (const MethodResult& method : sequence.methods) {
      const auto inliers = std::count_if(method.shown.begin(), method.shown.end(),
                                         [](const ShownMatch& match) { return match.inlier; });
      html += figure(
          match_chart(sequence, i, method),
          fmt::format("{}: {} matches, {} inliers", method.name, method.shown.size(), inliers));
    }
    html += "</div>\n";
  }
  return html;
}

std::string introduction(const Study& study, const StudyOptions& options) {
  std::string html = fmt::format(
      "<h1>Feature study</h1>\n<p>The motion from the fisheye to the left camera from one pair of "
      "images, by an essential matrix in RANSAC. One frame of {}; {} features per image; inliers "
      "within {} px at the mean focal length; masks {}. AUC: area under the curve below, 0 to 180 "
      "degrees, 1 is without error; a motion that was not found counts as 180 degrees. Times are "
      "CPU time, "
      "medians, one thread.</p>\n<p class=\"soft\">hybrid_slam {}, commit {}</p>\n",
      options.every, options.sift.max_features, options.threshold, options.masks ? "on" : "off",
      kVersion, kGitCommit);
  for (const std::string& line : study.missing) html += "<p>" + html_text(line) + "</p>\n";
  return html;
}

}  // namespace

std::string study_page(const Study& study, const StudyOptions& options) {
  std::string html = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta "
      "name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<meta "
      "http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; "
      "style-src 'unsafe-inline'\">\n<link rel=\"icon\" href=\"data:,\">\n<title>Feature study - "
      "hybrid_slam</title>\n<style>{}</style>\n</head>\n<body>\n",
      kStyle);
  html += introduction(study, options);
  html += "<h2>Speed against quality</h2>\n" +
          figure(speed_chart(study),
                 "mean AUC of the translation over all sequences, undistorted coordinates");
  html += model_section(study, StudyModel::kPlane,
                        "Essential matrix on undistorted coordinates, as in the paper");
  html += model_section(study, StudyModel::kBearings, "Essential matrix on bearings");
  return html + match_section(study) + "</body>\n</html>\n";
}

}  // namespace hybrid_slam
