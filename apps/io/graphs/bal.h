#pragma once

#include "apps/io/graphs/graph_file.h"

namespace hybrid_slam {

// "Bundle Adjustment in the Large": counts, observations `camera point u v`, 9 numbers per camera
// (angle-axis, translation, f, k1, k2), 3 per point. The first camera's pose is fixed, every
// camera's f, k1 and k2 may be refined.
GraphFile read_bal(const std::filesystem::path& path);

// For graphs whose frame i has camera i, a Bal one. Throws OutputError.
void write_bal(const std::filesystem::path& path, const FactorGraph& graph);

}  // namespace hybrid_slam
