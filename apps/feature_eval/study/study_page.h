#pragma once

#include <string>

#include "apps/feature_eval/study/study.h"

namespace hybrid_slam {

// The study as one HTML page that needs nothing else: tables, curves, speed against quality, and
// matches of one pair per sequence. Follows the reader's choice of dark or light.
std::string study_page(const Study& study, const StudyOptions& options);

}  // namespace hybrid_slam
