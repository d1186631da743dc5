#include "apps/python/python_factor.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "cameras/geometry/se3.h"

namespace hybrid_slam::python {

PythonFactor::PythonFactor(py::function function, const std::vector<GraphVariable>& variables,
                           const std::vector<int>& sizes, int residuals,
                           std::shared_ptr<RaisedError> error)
    : function_(std::move(function)), variables_(variables), error_(std::move(error)) {
  set_num_residuals(residuals);
  *mutable_parameter_block_sizes() = sizes;
}

PythonFactor::~PythonFactor() {
  const py::gil_scoped_acquire acquire;
  function_.release().dec_ref();
}

py::object PythonFactor::call(const Values& values) const {
  py::tuple arguments(values.size());
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (is_pose(k)) {
      Rigid3d pose;
      pose.params = values[k];
      arguments[k] = py::cast(to_matrix(pose));
    } else {
      arguments[k] = py::cast(values[k]);
    }
  }
  return function_(*arguments);
}

Eigen::VectorXd PythonFactor::residual_of(const py::object& result) const {
  const auto residual =
      py::isinstance<py::tuple>(result) ? py::object(result.cast<py::tuple>()[0]) : result;
  const auto values =
      py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(residual);
  if (!values || values.size() != num_residuals()) {
    throw std::invalid_argument("the factor gives no " + std::to_string(num_residuals()) +
                                " numbers as its residual");
  }
  return Eigen::Map<const Eigen::VectorXd>(values.data(), values.size());
}

void PythonFactor::write_given(const py::sequence& given, double** jacobians) const {
  if (given.size() != variables_.size())
    throw std::invalid_argument("the factor gives not one Jacobian for each variable");
  for (std::size_t k = 0; k < variables_.size(); ++k) {
    if (jacobians[k] == nullptr) continue;
    const int size = parameter_block_sizes()[k];
    const int columns = is_pose(k) ? 6 : size;
    const auto values =
        py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(given[k]);
    if (!values || values.ndim() != 2 || values.shape(0) != num_residuals() ||
        values.shape(1) != columns) {
      throw std::invalid_argument("the factor's Jacobian " + std::to_string(k) +
                                  " is not of shape (" + std::to_string(num_residuals()) + ", " +
                                  std::to_string(columns) + ")");
    }
    Eigen::Map<Rows> out(jacobians[k], num_residuals(), size);
    out.setZero();
    out.leftCols(columns) = Eigen::Map<const Rows>(values.data(), num_residuals(), columns);
  }
}

void PythonFactor::write_differences(const Values& values, double** jacobians) const {
  constexpr double kStep = 1e-6;  // a third of the digits: for central differences the best
  Values moved = values;
  for (std::size_t k = 0; k < variables_.size(); ++k) {
    if (jacobians[k] == nullptr) continue;
    Eigen::Map<Rows> out(jacobians[k], num_residuals(), parameter_block_sizes()[k]);
    out.setZero();
    for (Eigen::Index i = 0; i < (is_pose(k) ? 6 : values[k].size()); ++i) {
      const double step = kStep * (is_pose(k) ? 1 : std::max(1.0, std::abs(values[k][i])));
      const auto at = [&](double by) {
        if (is_pose(k)) {
          Rigid3d pose;
          pose.params = values[k];
          moved[k] = (se3_exp(by * Vector6d::Unit(i)) * pose).params;
        } else {
          moved[k][i] = values[k][i] + by;
        }
        return residual_of(call(moved));
      };
      const Eigen::VectorXd ahead = at(step);
      out.col(i) = (ahead - at(-step)) / (2 * step);
      moved[k] = values[k];
    }
  }
}

bool PythonFactor::Evaluate(const double* const* blocks, double* residual,
                            double** jacobians) const {
  const py::gil_scoped_acquire acquire;
  try {
    Values values;
    for (std::size_t k = 0; k < variables_.size(); ++k) {
      values.emplace_back(Eigen::Map<const Eigen::VectorXd>(blocks[k], parameter_block_sizes()[k]));
    }
    const py::object result = call(values);
    Eigen::Map<Eigen::VectorXd>(residual, num_residuals()) = residual_of(result);
    if (jacobians == nullptr) return true;
    if (py::isinstance<py::tuple>(result)) {
      write_given(result.cast<py::tuple>()[1].cast<py::sequence>(), jacobians);
    } else {
      write_differences(values, jacobians);
    }
    return true;
  } catch (...) {
    if (!error_->first) error_->first = std::current_exception();
    return false;
  }
}

}  // namespace hybrid_slam::python
