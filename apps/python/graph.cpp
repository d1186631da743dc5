#include <limits>
#include <utility>

#include "apps/python/python_factor.h"
#include "backend/incremental/incremental_solver.h"

namespace hybrid_slam::python {
namespace {

const std::map<std::string, Loss> kLosses{
    {"none", Loss::kNone}, {"huber", Loss::kHuber}, {"cauchy", Loss::kCauchy}};
using Kind = GraphVariable::Kind;

std::uint32_t index_of(const GraphVariable& variable, Kind kind, const char* name) {
  if (variable.kind != kind) throw std::invalid_argument(std::string("the variable is no ") + name);
  return variable.index;
}

std::string repr(const GraphVariable& variable) {
  const char* kind = variable.kind == Kind::kPose    ? "pose"
                     : variable.kind == Kind::kPoint ? "point"
                                                     : "block";
  return std::string("<hybrid_slam.Variable ") + kind + " " + std::to_string(variable.index) + ">";
}

// The backend's incremental solver in Python.
class PythonGraph {
 public:
  explicit PythonGraph(const IncrementalOptions& options) : solver_(options) {}

  IncrementalSolver& solver() { return solver_; }

  // What runs factors, without the GIL; what they raised is raised afterwards.
  template <typename Run>
  auto run(const Run& run) {
    error_->first = nullptr;
    auto result = [&] {
      const py::gil_scoped_release release;
      return run();
    }();
    if (error_->first) std::rethrow_exception(std::exchange(error_->first, nullptr));
    return result;
  }

  Eigen::VectorXd numbers(const GraphVariable& variable) const {
    if (variable.kind == Kind::kPose) return pose(variable).params;
    return variable.kind == Kind::kPoint ? Eigen::VectorXd(solver_.point(check(variable, points_)))
                                         : solver_.block(check(variable, blocks_));
  }

  py::object value(const GraphVariable& variable) const {
    return variable.kind == Kind::kPose ? py::cast(to_matrix(pose(variable)))
                                        : py::cast(numbers(variable));
  }

  GraphVariable add_point(const Eigen::Vector3d& point) {
    return {Kind::kPoint, remember(points_, solver_.add_point(point))};
  }

  GraphVariable add_block(const GraphBlock& block) {
    return {Kind::kBlock, remember(blocks_, solver_.add_block(block))};
  }

  void remove(const GraphVariable& variable) {
    if (variable.kind == Kind::kPoint) {
      solver_.remove_point(check(variable, points_));
      points_[variable.index] = 0;
    } else {
      solver_.remove_block(
          check({Kind::kBlock, index_of(variable, Kind::kBlock, "point or block")}, blocks_));
      blocks_[variable.index] = 0;
    }
  }

  std::uint32_t add_factor(py::function function, const std::vector<GraphVariable>& variables,
                           const std::string& loss, double threshold) {
    std::vector<int> sizes;
    std::vector<Eigen::VectorXd> values;
    py::tuple arguments(variables.size());
    for (std::size_t k = 0; k < variables.size(); ++k) {
      values.push_back(numbers(variables[k]));
      sizes.push_back(static_cast<int>(values.back().size()));
      arguments[k] = value(variables[k]);
    }
    const py::object result = function(*arguments);
    const py::object residual =
        py::isinstance<py::tuple>(result) ? py::object(result.cast<py::tuple>()[0]) : result;
    const auto rows =
        py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(residual);
    if (!rows || rows.size() == 0)
      throw std::invalid_argument("the factor's residual is no vector of numbers");
    GraphFactor factor;
    factor.function = std::make_shared<PythonFactor>(std::move(function), variables, sizes,
                                                     static_cast<int>(rows.size()), error_);
    factor.variables = variables;
    factor.loss = to_enum("loss", kLosses, loss);
    factor.threshold = threshold;
    return run([&] { return solver_.add_factor(factor); });
  }

 private:
  static std::uint32_t remember(std::vector<char>& there, std::uint32_t index) {
    if (index >= there.size()) there.resize(index + 1);
    there[index] = 1;
    return index;
  }

  static std::uint32_t check(const GraphVariable& variable, const std::vector<char>& there) {
    if (variable.index >= there.size() || there[variable.index] == 0)
      throw std::invalid_argument(repr(variable) + " is not in the graph");
    return variable.index;
  }

  Rigid3d pose(const GraphVariable& variable) const {
    if (variable.index >= solver_.pose_count())
      throw std::invalid_argument(repr(variable) + " is not in the graph");
    return solver_.pose(variable.index);
  }

  std::shared_ptr<RaisedError> error_ = std::make_shared<RaisedError>();
  std::vector<char> points_, blocks_;  // which indices are in use
  IncrementalSolver solver_;
};

std::unique_ptr<PythonGraph> make_graph(int window, const std::string& loss,
                                        const std::string& loop_loss, int max_steps) {
  IncrementalOptions options;
  options.window = window;
  options.loss = to_enum("loss", kLosses, loss);
  options.loop_loss = to_enum("loop_loss", kLosses, loop_loss);
  options.max_steps = max_steps;
  if (const std::string fault = options.validate(); !fault.empty())
    throw std::invalid_argument(fault);
  return std::make_unique<PythonGraph>(options);
}

std::vector<GraphVariable> moved(const UpdateSummary& summary) {
  std::vector<GraphVariable> variables;
  for (const std::uint32_t pose : summary.moved) variables.push_back(pose_variable(pose));
  for (const std::uint32_t block : summary.moved_blocks) variables.push_back(block_variable(block));
  return variables;
}

std::uint32_t add_observation(PythonGraph& graph, const GraphVariable& pose,
                              const GraphVariable& point, const Eigen::VectorXd& measurement,
                              double sigma) {
  if (measurement.size() != 2 && measurement.size() != 3)
    throw std::invalid_argument("a measurement is (u, v) or (u_left, v, u_right)");
  GraphObservation observation;
  observation.frame = index_of(pose, Kind::kPose, "pose");
  observation.point = index_of(point, Kind::kPoint, "point");
  observation.measurement << measurement.head<2>(),
      measurement.size() == 3 ? measurement[2] : std::numeric_limits<double>::quiet_NaN();
  observation.sigma = sigma;
  return graph.solver().add_observation(observation);
}

void bind_values(py::module_& module) {
  py::class_<GraphVariable>(module, "Variable", "A pose, point or block of a Graph.")
      .def("__eq__",
           [](const GraphVariable& a, const py::object& b) {
             return py::isinstance<GraphVariable>(b) && a == b.cast<GraphVariable>();
           })
      .def("__hash__",
           [](const GraphVariable& v) {
             return (static_cast<std::size_t>(v.index) << 2) | static_cast<std::size_t>(v.kind);
           })
      .def("__repr__", &repr);
  py::class_<UpdateSummary>(module, "UpdateSummary", "What an update did.")
      .def_readonly("steps", &UpdateSummary::steps)
      .def_readonly("poses", &UpdateSummary::poses, "Factored anew, over all steps.")
      .def_readonly("relinearized", &UpdateSummary::relinearized, "Terms.")
      .def_readonly("pending", &UpdateSummary::pending, "Terms that wait to be linearised anew.")
      .def_readonly("undetermined", &UpdateSummary::undetermined,
                    "Directions that no term determines, and that were held.")
      .def_property_readonly("moved", &moved, "Poses and blocks whose estimate changed.");
}

void bind_additions(py::class_<PythonGraph>& graph) {
  graph
      .def(
          "add_camera",
          [](PythonGraph& g, const AnyCamera& camera) {
            return g.solver().add_camera(camera.camera);
          },
          py::arg("camera"), "For add_pose(). Returns its number.")
      .def(
          "add_pose",
          [](PythonGraph& g, const Eigen::Matrix4d& cam_from_world,
             std::optional<std::uint32_t> camera, bool fixed) {
            return pose_variable(g.solver().add_pose(
                {to_rigid(cam_from_world), camera.value_or(GraphFrame::kNoCamera), fixed}));
          },
          py::arg("cam_from_world"), py::kw_only(), py::arg("camera") = std::nullopt,
          py::arg("fixed") = false, "(4, 4) [m]")
      .def("add_point", &PythonGraph::add_point, py::arg("in_world"), "(3,) [m]")
      .def(
          "add_block",
          [](PythonGraph& g, const Eigen::VectorXd& values, bool fixed, bool shared) {
            return g.add_block({.values = values, .fixed = fixed, .shared = shared});
          },
          py::arg("values"), py::kw_only(), py::arg("fixed") = false, py::arg("shared") = false,
          "Some numbers, (n,). `shared`: many factors have it, as they do a calibration.")
      .def("add_observation", &add_observation, py::arg("pose"), py::arg("point"),
           py::arg("measurement"), py::arg("sigma") = 1.0,
           "A point seen in a pose that has a camera: (u, v) or (u_left, v, u_right) [px]; sigma "
           "[px]. Returns its number.")
      .def(
          "add_edge",
          [](PythonGraph& g, const GraphVariable& a, const GraphVariable& b,
             const Eigen::Matrix4d& a_from_b, const Matrix6d& information, bool loop) {
            return g.solver().add_edge({index_of(a, Kind::kPose, "pose"),
                                        index_of(b, Kind::kPose, "pose"), to_rigid(a_from_b),
                                        information, loop});
          },
          py::arg("a"), py::arg("b"), py::arg("a_from_b"), py::arg("information"), py::kw_only(),
          py::arg("loop") = false,
          "A measured motion (4, 4); information (6, 6), translation first [1/m, 1/rad], squared, "
          "in frame b. Returns its number.")
      .def("add_factor", &PythonGraph::add_factor, py::arg("function"), py::arg("variables"),
           py::kw_only(), py::arg("loss") = "none", py::arg("threshold") = 1.0,
           "A factor of one's own: function(*values) -> residual (m,), whitened, or (residual, "
           "[jacobian, ...]). Values: a pose as "
           "cam_from_world (4, 4), a point as (3,), a block as (n,). Jacobians: (m, 6) of a pose "
           "by d in exp(d) cam_from_world, (m, 3), (m, n); "
           "without them by central differences. At most one point. `loss`: none, huber or cauchy, "
           "from the squared residual `threshold` on. "
           "Returns its number.");
}

}  // namespace

void bind_graph(py::module_& module) {
  bind_values(module);
  py::class_<PythonGraph> graph(
      module, "Graph",
      "A graph that grows and is smoothed incrementally: the backend of the SLAM.");
  graph.def(py::init(&make_graph), py::kw_only(), py::arg("window") = 0, py::arg("loss") = "none",
            py::arg("loop_loss") = "none", py::arg("max_steps") = 3,
            "`window`: poses that stay, older ones are marginalised; 0: all. `loss` of "
            "observations and `loop_loss` of loops: none, huber or "
            "cauchy. `max_steps`: Gauss-Newton steps per update.");
  bind_additions(graph);
  graph
      .def("remove", &PythonGraph::remove, py::arg("variable"),
           "A point or block, with its observations and factors.")
      .def(
          "remove_observation",
          [](PythonGraph& g, std::uint32_t i) { g.solver().remove_observation(i); },
          py::arg("observation"))
      .def(
          "remove_edge", [](PythonGraph& g, std::uint32_t i) { g.solver().remove_edge(i); },
          py::arg("edge"))
      .def(
          "remove_factor", [](PythonGraph& g, std::uint32_t i) { g.solver().remove_factor(i); },
          py::arg("factor"))
      .def(
          "set_fixed",
          [](PythonGraph& g, const GraphVariable& v, bool fixed) {
            g.solver().set_fixed(v, fixed);
          },
          py::arg("variable"), py::arg("fixed"), "Of a pose or block, from the next update on.")
      .def(
          "marginalize",
          [](PythonGraph& g, const std::vector<GraphVariable>& variables) {
            g.run([&] {
              g.solver().marginalize(variables);
              return 0;
            });
          },
          py::arg("variables"),
          "Poses and blocks leave; what is known of others through them stays.")
      .def(
          "update", [](PythonGraph& g) { return g.run([&] { return g.solver().update(); }); },
          "Takes in what was added and removed. Raises what a factor raised.")
      .def("value", &PythonGraph::value, py::arg("variable"),
           "The estimate: cam_from_world (4, 4), (3,) or (n,).")
      .def(
          "covariance",
          [](PythonGraph& g, const std::vector<GraphVariable>& variables) {
            return g.run([&] { return g.solver().covariance(variables); });
          },
          py::arg("variables"),
          "Joint covariance: 6 rows of a pose (left perturbation), 3 of a point, n of a block.")
      .def(
          "chi2", [](PythonGraph& g, std::uint32_t i) { return g.solver().chi2(i); },
          py::arg("observation"), "Squared whitened residual.")
      .def(
          "cost", [](PythonGraph& g) { return g.run([&] { return g.solver().cost(); }); },
          "Half the sum of squares of all terms, without a loss.");
}

}  // namespace hybrid_slam::python
