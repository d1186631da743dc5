#pragma once

#include <string>

#include "apps/feature_eval/study/study.h"

namespace hybrid_slam {

// Text as it may stand in HTML and SVG.
std::string html_text(const std::string& text);

// What a method's lines and marks look like in every chart: CSS classes and a dash pattern, by its
// place in the list.
std::string line_style(std::size_t method);

// A small piece of the line, with the name: for keys of charts.
std::string chart_key(const SequenceResult& sequence);

// "Share of the pairs with at most this error": rotation or direction of the translation, all
// methods. The axis of degrees is stretched where errors are small: it goes by their square root.
enum class ErrorKind { kRotation, kDirection };
std::string curve_chart(const SequenceResult& sequence, StudyModel model, ErrorKind kind);

// Mean AUC of the translation over all sequences against the milliseconds of one pair: two images
// and their match. The axis of time goes by its logarithm.
std::string speed_chart(const Study& study);

// Both images of the shown pair, side by side, to be drawn once ...
std::string shown_images(const SequenceResult& sequence, std::size_t number);
// ... and a method's matches on them: inliers as lines, others as short dashes.
std::string match_chart(const SequenceResult& sequence, std::size_t number,
                        const MethodResult& method);

}  // namespace hybrid_slam
