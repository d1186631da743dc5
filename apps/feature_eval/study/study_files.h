#pragma once

#include <string>

#include "apps/feature_eval/study/study.h"

namespace hybrid_slam {

// Makes the folder and writes an empty table into it, so that what cannot be written is known
// before the work. Throws OutputError.
void prepare_study_folder(const std::string& folder);

// Columns of the tables in CSV.
inline constexpr const char* kStudyColumns =
    "sequence,method,auc_rotation,auc_translation,mean_inliers,ms_per_image,ms_per_match";

// A row per sequence and method.
std::string study_csv(const Study& study, StudyModel model);

// "sequence,frame,method,left_keypoints,fisheye_keypoints,matches", then of each model
// "_inliers,_rotation_deg,_translation_deg": a row per pair of images and method.
std::string pairs_csv(const Study& study);

// Tables of both models to read, and what is missing.
std::string study_text(const Study& study);

// The table of kPlane: a row per method, three columns per sequence; best figures in bold.
std::string study_latex(const Study& study);

// study.csv, study_bearings.csv, pairs.csv, study.txt, study.tex and study.html. Throws
// OutputError.
void write_study(const Study& study, const StudyOptions& options);

}  // namespace hybrid_slam
