#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apps/feature_eval/feature_method.h"

namespace hybrid_slam {

struct NamedMethod {
  std::string name;  // in tables
  std::unique_ptr<FeatureMethod> method;
};

// Names that can follow one another, with commas between: "sift,rootsift,onnx:hardnet.yaml".
std::vector<std::string> split_method_names(const std::string& list);

// Empty if it is the name of a method, whether that can be used here or not; else what is wrong
// with it.
std::string why_no_method_name(const std::string& name);

// The methods of these names that can be used here. Of each other one `missing` gets a line.
// Throws InputError for a contract or a network that cannot be used, or if two have one name.
std::vector<NamedMethod> make_methods(const std::vector<std::string>& names,
                                      const SiftOptions& sift, std::vector<std::string>& missing);

}  // namespace hybrid_slam
