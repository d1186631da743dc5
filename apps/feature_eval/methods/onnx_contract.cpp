#include "apps/feature_eval/methods/onnx_contract.h"

#include <filesystem>

#include "cameras/files/yaml_section.h"

namespace hybrid_slam {
namespace {

constexpr int kLargestSide = 16384;  // [px]

int whole(const YamlSection& section, const std::string& key, int otherwise, int least, int most) {
  if (!section.has(key)) return otherwise;
  const int value = section.value<int>(key);
  if (value < least || value > most) {
    section.fail(key, "must be from " + std::to_string(least) + " to " + std::to_string(most));
  }
  return value;
}

double number(const YamlSection& section, const std::string& key, double otherwise) {
  return section.has(key) ? section.number(key) : otherwise;
}

double positive(const YamlSection& section, const std::string& key, double otherwise) {
  const double value = number(section, key, otherwise);
  if (!(value > 0)) section.fail(key, "must be positive");
  return value;
}

// One of two words.
bool is_first(const YamlSection& section, const std::string& key, const std::string& first,
              const std::string& second) {
  const std::string word = section.text(key);
  if (word != first && word != second) {
    section.fail(key, "must be " + first + " or " + second);
  }
  return word == first;
}

void read_input(const YamlSection& section, OnnxContract& contract) {
  const bool patches = contract.kind == OnnxContract::Kind::kPatchDescriptor;
  section.refuse_all_but({"width", "height", "scale", "mean", "deviation", "per_patch"});
  contract.width = whole(section, "width", patches ? 32 : 0, patches ? 1 : 0, kLargestSide);
  contract.height = whole(section, "height", patches ? 32 : 0, patches ? 1 : 0, kLargestSide);
  if ((contract.width == 0) != (contract.height == 0)) {
    section.fail(section.has("width") ? "width" : "height", "width and height: both 0 or neither");
  }
  contract.scale = number(section, "scale", 1);
  contract.mean = number(section, "mean", 0);
  contract.deviation = positive(section, "deviation", 1);
  if (section.has("per_patch")) {
    if (!patches) section.fail("per_patch", "is for a patch_descriptor");
    contract.per_patch = section.value<bool>("per_patch");
  }
}

void read_descriptor(const YamlSection& section, OnnxContract& contract) {
  section.refuse_all_but({"length", "distance"});
  section.value<int>("length");  // must be there
  contract.length = whole(section, "length", 0, 1, 4096);
  contract.unit = !section.has("distance") || is_first(section, "distance", "cosine", "l2");
}

void read_detector(const YamlSection& section, OnnxContract& contract) {
  section.refuse_all_but({"scores", "cell", "threshold", "radius", "border"});
  if (section.has("scores")) {
    contract.scores = is_first(section, "scores", "cells", "map") ? OnnxContract::Scores::kCells
                                                                  : OnnxContract::Scores::kMap;
  }
  contract.cell = whole(section, "cell", 8, 1, 64);
  contract.threshold = number(section, "threshold", contract.threshold);
  contract.radius = whole(section, "radius", 4, 0, 64);
  contract.border = whole(section, "border", 4, 0, 256);
}

void read_patch(const YamlSection& section, OnnxContract& contract) {
  section.refuse_all_but({"scales", "batch"});
  contract.patch_scales = positive(section, "scales", contract.patch_scales);
  contract.batch = whole(section, "batch", 1, 1, 4096);
}

}  // namespace

OnnxContract read_onnx_contract(const std::string& path) {
  namespace fs = std::filesystem;
  const YamlSection file = YamlSection::read(path);
  file.refuse_all_but(
      {"name", "model", "kind", "input", "descriptor", "patch", "detector", "ratio"});
  OnnxContract contract;
  const bool patches = is_first(file, "kind", "patch_descriptor", "dense_detector");
  contract.kind =
      patches ? OnnxContract::Kind::kPatchDescriptor : OnnxContract::Kind::kDenseDetector;
  const fs::path model = file.text("model");
  contract.model = (model.is_absolute() ? model : fs::path(path).parent_path() / model).string();
  contract.name = file.has("name") ? file.text("name") : fs::path(path).stem().string();
  if (contract.name.empty() || contract.name.find_first_of(",\"\n\r") != std::string::npos) {
    file.fail("name", "must not be empty or hold commas and quotes");
  }
  contract.ratio = positive(file, "ratio", contract.ratio);
  if (contract.ratio > 1) file.fail("ratio", "must be at most 1");
  const auto section = [&](const char* key, auto read) {
    if (file.has(key)) read(file.child(key), contract);
  };
  if (!file.has("input") && !patches) contract.width = contract.height = 0;
  section("input", read_input);
  read_descriptor(file.child("descriptor"), contract);
  if (file.has(patches ? "detector" : "patch")) {
    file.fail(patches ? "detector" : "patch", "does not go with this kind");
  }
  section("patch", read_patch);
  section("detector", read_detector);
  if (!patches && (contract.width % contract.cell != 0 || contract.height % contract.cell != 0)) {
    file.fail("input", "width and height must be multiples of the cell");
  }
  if (!patches && contract.scores == OnnxContract::Scores::kCells &&
      contract.length == contract.cell * contract.cell + 1) {
    file.fail("descriptor", "as long as a cell has scores: which output is which?");
  }
  return contract;
}

}  // namespace hybrid_slam
