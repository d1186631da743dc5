#pragma once

#include "cameras/geometry/se3.h"

namespace hybrid_slam {

// A motion that was measured, with the covariance of its left perturbation: d in exp(d) * b_from_a,
// (translation, rotation) [m, rad].
struct UncertainMotion {
  Rigid3d b_from_a;
  Matrix6d covariance = Matrix6d::Zero();  // exactly symmetric
};

// One after the other, of errors that are independent:
//   exp(d2) B exp(d1) A = exp(d2 + adjoint(B) d1) B A, to first order.
inline UncertainMotion operator*(const UncertainMotion& c_from_b, const UncertainMotion& b_from_a) {
  const Matrix6d carry = adjoint(c_from_b.b_from_a);
  const Matrix6d sum = c_from_b.covariance + carry * b_from_a.covariance * carry.transpose();
  return {c_from_b.b_from_a * b_from_a.b_from_a, 0.5 * (sum + sum.transpose())};
}

}  // namespace hybrid_slam
