#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apps/io/stage_times.h"
#include "backend/map/features.h"
#include "frontend/features/image.h"
#include "frontend/features/sift.h"
#include "frontend/matching/brute_force.h"

namespace hybrid_slam {

// The name of an entry of StageTimes: all of one extraction, or of one match, as it is without
// its stages being measured.
inline constexpr const char* kTotal = "total";

// A way to find, describe and match features: what feature_eval compares with others. One instance
// is used by one thread at a time.
class FeatureMethod {
 public:
  virtual ~FeatureMethod() = default;

  // Adds to `times` the total and each stage.
  virtual FeatureSet extract(const GrayImage& image, StageTimes& times) = 0;

  // Matches that are mutually nearest and pass the ratio test at kMatchRatio, ascending by query.
  virtual std::vector<DescriptorMatch> match(const FeatureSet& query, const FeatureSet& train,
                                             StageTimes& times) = 0;
};

inline constexpr double kMatchRatio = 0.8;

enum class FeatureEngine { kCpu, kCuda, kOpenCv };

std::string to_string(FeatureEngine engine);

// Empty if the engine can be used here with these options, else why not, in one line.
std::string why_no_engine(FeatureEngine engine, const SiftOptions& options);

// SIFT by one that can be used.
std::unique_ptr<FeatureMethod> make_sift_method(FeatureEngine engine, const SiftOptions& options);

}  // namespace hybrid_slam
