#include "apps/io/graphs/colmap_model.h"

#include <fmt/format.h>

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

std::string_view extension(ColmapVariant variant) {
  return variant == ColmapVariant::kText ? ".txt" : ".bin";
}

}  // namespace

fs::path ColmapModel::file(std::string_view name) const {
  return folder / fmt::format("{}{}", name, extension(variant));
}

InputError ColmapModel::error(std::string_view name, std::uint64_t place,
                              std::string_view reason) const {
  const char* const format = variant == ColmapVariant::kText ? "{}:{}: {}" : "{}: byte {}: {}";
  return InputError(fmt::format(fmt::runtime(format), file(name).string(), place, reason));
}

bool has_colmap_model(const fs::path& folder, ColmapVariant variant) {
  std::error_code ignored;
  ColmapModel model;
  model.folder = folder;
  model.variant = variant;
  return fs::exists(model.file("cameras"), ignored) && fs::exists(model.file("images"), ignored);
}

void remove_colmap_model(const fs::path& folder) {
  ColmapModel model;
  model.folder = folder;
  for (const ColmapVariant variant : {ColmapVariant::kText, ColmapVariant::kBinary}) {
    model.variant = variant;
    for (const char* const name : {"cameras", "images", "points3D", "rigs", "frames"}) {
      std::error_code ignored;
      fs::remove(model.file(name), ignored);
    }
  }
}

}  // namespace hybrid_slam
