#pragma once

#include <ceres/cost_function.h>

#include <exception>
#include <memory>
#include <vector>

#include "apps/python/conversions.h"
#include "backend/problem/graph_factor.h"
#include "factors/left_jacobian.h"

namespace hybrid_slam::python {

// The first error that functions in Python raised while a solver ran, to be raised when it is done.
struct RaisedError {
  std::exception_ptr first;
};

// A factor that is a function in Python: f(*values) -> residual (m,), or (residual, [jacobian,
// ...]). A pose is handed over as cam_from_world (4, 4), a point as (3,), a block as (n,).
// Jacobians: (m, 6) of a pose by its left perturbation d in exp(d) cam_from_world, (translation,
// rotation); (m, 3) and (m, n) of the others. Without them they are found by central differences.
class PythonFactor final : public ceres::CostFunction, public LeftJacobian {
 public:
  PythonFactor(py::function function, const std::vector<GraphVariable>& variables,
               const std::vector<int>& sizes, int residuals, std::shared_ptr<RaisedError> error);
  ~PythonFactor() override;
  PythonFactor(const PythonFactor&) = delete;
  PythonFactor& operator=(const PythonFactor&) = delete;

  // With or without the GIL. False, and the error is kept, where the function raises one.
  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override;

 private:
  using Values = std::vector<Eigen::VectorXd>;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  py::object call(const Values& values) const;
  Eigen::VectorXd residual_of(const py::object& result) const;
  void write_given(const py::sequence& given, double** jacobians) const;
  void write_differences(const Values& values, double** jacobians) const;
  bool is_pose(std::size_t k) const { return variables_[k].kind == GraphVariable::Kind::kPose; }

  py::function function_;
  std::vector<GraphVariable> variables_;
  std::shared_ptr<RaisedError> error_;
};

}  // namespace hybrid_slam::python
