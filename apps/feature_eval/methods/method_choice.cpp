#include "apps/feature_eval/methods/method_choice.h"

#include <algorithm>
#include <set>

#include "apps/feature_eval/methods/onnx_methods.h"
#include "apps/feature_eval/methods/opencv_features.h"
#include "cameras/files/input_error.h"

namespace hybrid_slam {
namespace {

const std::string kOnnx = "onnx:";

bool is_opencv(const std::string& name) {
  const auto& names = opencv_feature_names();
  return std::find(names.begin(), names.end(), name) != names.end();
}

NamedMethod make_method(const std::string& name, const SiftOptions& sift) {
  if (name.starts_with(kOnnx)) {
    const OnnxContract contract = read_onnx_contract(name.substr(kOnnx.size()));
    return {contract.name, make_onnx_method(contract, sift)};
  }
  if (is_opencv(name)) return {name, make_opencv_features(name, sift.max_features)};
  const auto kind = name == "sift" ? SiftDescriptor::kPlain : SiftDescriptor::kRoot;
  return {name, make_sift_method(FeatureEngine::kCpu, sift, kind)};
}

}  // namespace

std::vector<std::string> split_method_names(const std::string& list) {
  std::vector<std::string> names(1);
  for (const char c : list) {
    if (c == ',') {
      names.emplace_back();
    } else {
      names.back() += c;
    }
  }
  return names;
}

std::string why_no_method_name(const std::string& name) {
  if (name == "sift" || name == "rootsift" || is_opencv(name)) return {};
  if (name.starts_with(kOnnx)) return name == kOnnx ? "onnx: needs a file: onnx:FILE.yaml" : "";
  std::string known = "sift, rootsift";
  for (const std::string& other : opencv_feature_names()) known += ", " + other;
  return "no method \"" + name + "\"; there are " + known + ", onnx:FILE.yaml";
}

std::vector<NamedMethod> make_methods(const std::vector<std::string>& names,
                                      const SiftOptions& sift, std::vector<std::string>& missing) {
  std::vector<NamedMethod> methods;
  std::set<std::string> taken;
  for (const std::string& name : names) {
    if (const std::string why = why_no_opencv_features(name); !why.empty()) {
      missing.push_back(name + ": missing: " + why);
      continue;
    }
    methods.push_back(make_method(name, sift));
    if (!taken.insert(methods.back().name).second) {
      throw InputError(name + ": a second method of the name " + methods.back().name);
    }
  }
  return methods;
}

}  // namespace hybrid_slam
