#include "frontend/calibration/row_field.h"

#include <algorithm>
#include <cmath>

namespace hybrid_slam {

double RowField::systematic_rms() const {
  double squares = 0, count = 0;
  for (const Moments& cell : moments_) {
    if (cell.count < 2) continue;
    squares += cell.count * cell.mean() * cell.mean() - cell.variance();
    count += cell.count;
  }
  return count > 0 ? std::sqrt(std::max(0.0, squares / count)) : 0;
}

}  // namespace hybrid_slam
