#include "backend/problem/openmp_threads.h"

#include <omp.h>

namespace hybrid_slam {

void allow_openmp_threads(bool allow) { omp_set_max_active_levels(allow ? 1 : 0); }

}  // namespace hybrid_slam
