#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

namespace ceres {
class Manifold;
}

namespace hybrid_slam {

// Another variable of a LinearPrior than a pose: a vector, or a point of a manifold.
struct PriorBlock {
  Eigen::VectorXd base;                             // in the axes of `carrier`, where it turns
  std::shared_ptr<const ceres::Manifold> manifold;  // null: a vector
  // Where three values each are a vector in the world's axes that turns with a pose: that with
  // index `carrier` among the prior's or, if there is none, one that is known.
  std::vector<int> world_vectors;
  int carrier = -1;
  Eigen::Matrix3d known_rotation = Eigen::Matrix3d::Identity();  // carrier's axes from the world's

  int tangent_size() const;
};

}  // namespace hybrid_slam
