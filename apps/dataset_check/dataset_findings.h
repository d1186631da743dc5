#pragma once

#include "apps/dataset_check/dataset_check.h"

namespace hybrid_slam {

// Adds what is missing and what was found, by the numbers that are there.
void judge(DatasetCheck& check);

}  // namespace hybrid_slam
