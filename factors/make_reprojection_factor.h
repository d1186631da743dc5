#pragma once

#include <memory>

#include <Eigen/Core>

#include "cameras/camera.h"

namespace ceres {
class CostFunction;
}

namespace hybrid_slam {

// The factor of one observation of `camera` (see ReprojectionFactor): blocks cam_from_world (7) and
// point_in_world (3). measurement: (u, v, u_right) [px]; u_right is NaN for a stereo pair's point
// without a right match, which then is a 2-d measurement of the left camera, and is ignored for
// the other models. sigma [px]. The one place where the kind of camera meets the factor's type.
// Throws std::logic_error unless u, v and sigma are finite and sigma is positive.
std::unique_ptr<ceres::CostFunction> make_reprojection_factor(const Camera& camera,
                                                              const Eigen::Vector3d& measurement,
                                                              double sigma);

// The same with the intrinsics as third block, of the size and order of the camera's params.
std::unique_ptr<ceres::CostFunction> make_refining_reprojection_factor(
    const Camera& camera, const Eigen::Vector3d& measurement, double sigma);

}  // namespace hybrid_slam
