#include "apps/python/conversions.h"
#include "apps/slam/version.h"
#include "backend/problem/solver_log.h"
#include "cameras/files/input_error.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam::python {
namespace {

void bind_errors(py::module_& module) {
  // They live as long as the interpreter.
  static PyObject* const error =
      PyErr_NewExceptionWithDoc("hybrid_slam.Error", "What this package raises.", nullptr, nullptr);
  const auto kind = [&](const char* name, const char* doc, PyObject* builtin) {
    const py::tuple bases = builtin != nullptr
                                ? py::tuple(py::make_tuple(py::handle(error), py::handle(builtin)))
                                : py::tuple(py::make_tuple(py::handle(error)));
    return PyErr_NewExceptionWithDoc(name, doc, bases.ptr(), nullptr);
  };
  static PyObject* const input =
      kind("hybrid_slam.InputError", "Bad input: file, place and reason in one line.", nullptr);
  static PyObject* const output =
      kind("hybrid_slam.OutputError", "A result could not be written.", nullptr);
  static PyObject* const usage =
      kind("hybrid_slam.UsageError", "What was asked for cannot be: a shape, a name, an index.",
           PyExc_ValueError);
  module.attr("Error") = py::handle(error);
  module.attr("InputError") = py::handle(input);
  module.attr("OutputError") = py::handle(output);
  module.attr("UsageError") = py::handle(usage);
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const InputError& e) {
      PyErr_SetString(input, e.what());
    } catch (const OutputError& e) {
      PyErr_SetString(output, e.what());
    } catch (const std::logic_error& e) {
      PyErr_SetString(usage, e.what());
    }
  });
}

// pybind11 before 2.12 reads the arrays of NumPy 2 where NumPy 1 had their fields: numbers come out
// wrong without a word.
void refuse_unknown_numpy() {
  if (PYBIND11_VERSION_HEX >= 0x020C0000) return;
  const std::string version = py::module_::import("numpy").attr("__version__").cast<std::string>();
  if (std::stoi(version) < 2) return;
  throw py::import_error(
      "hybrid_slam was built with a pybind11 that does not know NumPy " + version +
      ": install numpy<2, or build the module with `pip install .`, which brings a newer one");
}

}  // namespace
}  // namespace hybrid_slam::python

PYBIND11_MODULE(_native, module) {
  using namespace hybrid_slam::python;
  refuse_unknown_numpy();
  hybrid_slam::silence_solver_log();
  module.attr("__name__") = "hybrid_slam";  // where users find the classes
  bind_errors(module);
  bind_cameras(module);
  bind_trajectories(module);
  bind_input(module);
  bind_map(module);
  bind_session(module);
  bind_graph(module);
  module.attr("__version__") = hybrid_slam::kVersion;
  module.attr("__commit__") = hybrid_slam::kGitCommit;
  module.attr("__features__") = hybrid_slam::kFeatures;
  module.attr("__name__") = "hybrid_slam._native";
}
