#pragma once

namespace hybrid_slam {

// Whether OpenMP may start threads for what the calling thread runs from now on. CHOLMOD asks for
// four of them whatever the environment says, whose waiting costs more than a factorisation gains.
void allow_openmp_threads(bool allow);

}  // namespace hybrid_slam
