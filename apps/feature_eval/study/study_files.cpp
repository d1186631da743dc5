#include "apps/feature_eval/study/study_files.h"

#include <algorithm>
#include <filesystem>
#include <iterator>

#include <fmt/format.h>

#include "apps/feature_eval/study/study_page.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

const char* title_of(StudyModel model) {
  return model == StudyModel::kPlane ? "undistorted coordinates (as in the paper)" : "bearings";
}

// Underscores and the like mean something to LaTeX.
std::string latex_text(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (std::string("_%&#${}").find(c) != std::string::npos) escaped += '\\';
    escaped += c;
  }
  return escaped;
}

using Figure = double StudyScores::*;

// The highest figure of a sequence, as it is printed.
double best_of(const SequenceResult& sequence, Figure figure) {
  double best = 0;
  for (const MethodResult& method : sequence.methods) {
    best = std::max(best, scores_of(method, StudyModel::kPlane).*figure);
  }
  return best;
}

std::string latex_figure(const SequenceResult& sequence, const MethodResult& method, Figure figure,
                         const char* format) {
  const std::string text =
      fmt::format(fmt::runtime(format), scores_of(method, StudyModel::kPlane).*figure);
  const bool best = text == fmt::format(fmt::runtime(format), best_of(sequence, figure));
  return best ? "\\textbf{" + text + "}" : text;
}

}  // namespace

void prepare_study_folder(const std::string& folder) {
  make_folder(folder);
  write_file(fs::path(folder) / "study.csv", std::string(kStudyColumns) + "\n");
}

std::string study_csv(const Study& study, StudyModel model) {
  std::string csv = std::string(kStudyColumns) + "\n";
  for (const SequenceResult& sequence : study.sequences) {
    for (const MethodResult& method : sequence.methods) {
      const StudyScores s = scores_of(method, model);
      fmt::format_to(std::back_inserter(csv), "{},{},{:.4f},{:.4f},{:.1f},{:.2f},{:.2f}\n",
                     sequence.name, method.name, s.auc_rotation, s.auc_translation, s.mean_inliers,
                     s.ms_per_image, s.ms_per_match);
    }
  }
  return csv;
}

std::string pairs_csv(const Study& study) {
  std::string csv = "sequence,frame,method,left_keypoints,fisheye_keypoints,matches";
  for (const char* const model : {"plane", "bearings"}) {
    fmt::format_to(std::back_inserter(csv), ",{0}_inliers,{0}_rotation_deg,{0}_translation_deg",
                   model);
  }
  csv += "\n";
  for (const SequenceResult& sequence : study.sequences) {
    for (const MethodResult& method : sequence.methods) {
      for (const PairResult& pair : method.pairs) {
        fmt::format_to(std::back_inserter(csv), "{},{},{},{},{},{}", sequence.name, pair.frame,
                       method.name, pair.left_keypoints, pair.fisheye_keypoints, pair.matches);
        for (const MotionErrors& motion : pair.motion) {
          fmt::format_to(std::back_inserter(csv), ",{},{:.4f},{:.4f}", motion.inliers,
                         motion.rotation_deg, motion.direction_deg);
        }
        csv += "\n";
      }
    }
  }
  return csv;
}

std::string study_text(const Study& study) {
  std::string text;
  std::size_t width = 6;
  for (const MethodResult& method : study.sequences.front().methods) {
    width = std::max(width, method.name.size());
  }
  for (const StudyModel model : kStudyModels) {
    fmt::format_to(std::back_inserter(text), "Essential matrix on {}\n", title_of(model));
    for (const SequenceResult& sequence : study.sequences) {
      fmt::format_to(std::back_inserter(text),
                     "{} ({} pairs)\n  {:{}}  AUC rotation  AUC translation  mean inliers  "
                     "ms per image  ms per match\n",
                     sequence.name, sequence.methods.front().pairs.size(), "method", width);
      for (const MethodResult& method : sequence.methods) {
        const StudyScores s = scores_of(method, model);
        fmt::format_to(std::back_inserter(text),
                       "  {:{}}  {:12.4f}  {:15.4f}  {:12.1f}  {:12.2f}  {:12.2f}\n", method.name,
                       width, s.auc_rotation, s.auc_translation, s.mean_inliers, s.ms_per_image,
                       s.ms_per_match);
      }
    }
    text += "\n";
  }
  for (const std::string& line : study.missing) text += line + "\n";
  return text;
}

std::string study_latex(const Study& study) {
  std::string rule = "l", heads, columns = "method";
  for (const SequenceResult& sequence : study.sequences) {
    rule += "|ccc";
    heads += " & \\multicolumn{3}{c}{" + latex_text(sequence.name) + "}";
    columns += " & AUC$_R$ & AUC$_t$ & inliers";
  }
  std::string table =
      "\\begin{tabular}{" + rule + "}\n" + heads + " \\\\\n" + columns + " \\\\\n\\hline\n";
  for (std::size_t m = 0; m < study.sequences.front().methods.size(); ++m) {
    table += latex_text(study.sequences.front().methods[m].name);
    for (const SequenceResult& sequence : study.sequences) {
      const MethodResult& method = sequence.methods[m];
      table += " & " + latex_figure(sequence, method, &StudyScores::auc_rotation, "{:.3f}");
      table += " & " + latex_figure(sequence, method, &StudyScores::auc_translation, "{:.3f}");
      table += " & " + latex_figure(sequence, method, &StudyScores::mean_inliers, "{:.0f}");
    }
    table += " \\\\\n";
  }
  return table + "\\end{tabular}\n";
}

void write_study(const Study& study, const StudyOptions& options) {
  const fs::path folder = options.out;
  write_file(folder / "study.csv", study_csv(study, StudyModel::kPlane));
  write_file(folder / "study_bearings.csv", study_csv(study, StudyModel::kBearings));
  write_file(folder / "pairs.csv", pairs_csv(study));
  write_file(folder / "study.txt", study_text(study));
  write_file(folder / "study.tex", study_latex(study));
  write_file(folder / "study.html", study_page(study, options));
}

}  // namespace hybrid_slam
