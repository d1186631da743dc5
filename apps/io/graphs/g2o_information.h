#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cameras/geometry/se3.h"

namespace hybrid_slam {

// Informations as files have them: some are singular, as nothing was measured in a direction, and
// some even have eigenvalues below zero, as 5,021 of the 16,869 edges of the cubicle graph do.
// These are cut to zero: the nearest information that a measurement can have.
class InformationCuts {
 public:
  // The information, cut where that is needed; `line` is where it stands.
  Eigen::MatrixXd cut(const Eigen::MatrixXd& information, int line);

  // One line that counts; empty if nothing was cut or singular.
  std::vector<std::string> warnings(const std::string& source) const;

 private:
  std::size_t seen_ = 0;
  std::size_t singular_ = 0;
  std::size_t cut_ = 0;
  int worst_line_ = 0;
  double worst_ = 0;   // lowest eigenvalue by the highest
  double lowest_ = 0;  // the two of the worst
  double highest_ = 0;
};

}  // namespace hybrid_slam
