#pragma once

#include <memory>

#include "apps/python/conversions.h"
#include "backend/map/map_file.h"

namespace hybrid_slam::python {

// A map in Python.
struct MapView {
  std::shared_ptr<const MapSnapshot> snapshot;
  MapFileInfo info;
};

}  // namespace hybrid_slam::python
