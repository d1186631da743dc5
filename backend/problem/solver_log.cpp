#include "backend/problem/solver_log.h"

#include <glog/logging.h>

namespace hybrid_slam {

void silence_solver_log() { FLAGS_minloglevel = google::GLOG_FATAL; }

}  // namespace hybrid_slam
