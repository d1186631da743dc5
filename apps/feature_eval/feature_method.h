#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apps/feature_eval/methods/described_features.h"
#include "apps/io/stage_times.h"
#include "frontend/features/image.h"
#include "frontend/features/sift.h"

namespace hybrid_slam {

// The name of an entry of StageTimes: all of one extraction, or of one match, as it is without
// its stages being measured.
inline constexpr const char* kTotal = "total";

// A way to find, describe and match features: what feature_eval compares with others. One instance
// is used by one thread at a time.
class FeatureMethod {
 public:
  virtual ~FeatureMethod() = default;

  // Adds to `times` the total and each stage. `mask`: null, or an image of the same size whose zero
  // pixels must hold no keypoint.
  virtual DescribedFeatures extract(const GrayImage& image, const GrayImage* mask,
                                    StageTimes& times) = 0;

  // Matches that are mutually nearest and pass the method's ratio test (kMatchRatio where nothing
  // else is said), ascending by query. Adds to `times` the total.
  virtual std::vector<FeatureMatch> match(const DescribedFeatures& query,
                                          const DescribedFeatures& train, StageTimes& times);

 protected:
  explicit FeatureMethod(double ratio) : ratio_(ratio) {}

 private:
  double ratio_;
};

inline constexpr double kMatchRatio = 0.8;

enum class FeatureEngine { kCpu, kCuda, kOpenCv };

std::string to_string(FeatureEngine engine);

// Empty if the engine can be used here with these options, else why not, in one line.
std::string why_no_engine(FeatureEngine engine, const SiftOptions& options);

// RootSIFT, or the plain descriptor, L2-normalised.
enum class SiftDescriptor { kRoot, kPlain };

// SIFT by one that can be used.
std::unique_ptr<FeatureMethod> make_sift_method(FeatureEngine engine, const SiftOptions& options,
                                                SiftDescriptor kind = SiftDescriptor::kRoot);

}  // namespace hybrid_slam
