// Ceres' own example bundle_adjuster as a peer: ceres_bundle dense|sparse INPUT OUTPUT on a BAL
// problem. Jets, 9 parameters per camera, Schur elimination of the points; prints one line of JSON.

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <sys/resource.h>

#include <cstdio>
#include <ctime>
#include <fstream>
#include <string>
#include <vector>

namespace {

struct BalProblem {
  struct Observation {
    int camera = 0;
    int point = 0;
    double u = 0;
    double v = 0;
  };
  std::vector<Observation> observations;
  std::vector<double> cameras;  // 9 each: angle-axis, translation, f, k1, k2
  std::vector<double> points;   // 3 each
};

struct SnavelyError {
  double u, v;

  template <typename T>
  bool operator()(const T* camera, const T* point, T* residual) const {
    T p[3];
    ceres::AngleAxisRotatePoint(camera, point, p);
    for (int i = 0; i < 3; ++i) p[i] += camera[3 + i];
    const T x = -p[0] / p[2];
    const T y = -p[1] / p[2];
    const T r2 = x * x + y * y;
    const T scale = camera[6] * (1.0 + r2 * (camera[7] + camera[8] * r2));
    residual[0] = scale * x - u;
    residual[1] = scale * y - v;
    return true;
  }
};

BalProblem read(const std::string& path) {
  std::ifstream in(path);
  std::size_t cameras = 0;
  std::size_t points = 0;
  std::size_t observations = 0;
  in >> cameras >> points >> observations;
  BalProblem problem;
  problem.observations.resize(observations);
  for (auto& o : problem.observations) in >> o.camera >> o.point >> o.u >> o.v;
  problem.cameras.resize(9 * cameras);
  problem.points.resize(3 * points);
  for (double& x : problem.cameras) in >> x;
  for (double& x : problem.points) in >> x;
  if (!in) throw std::runtime_error(path + ": not a BAL problem");
  return problem;
}

void write(const std::string& path, const BalProblem& problem) {
  std::ofstream out(path);
  out.precision(17);
  out << problem.cameras.size() / 9 << ' ' << problem.points.size() / 3 << ' '
      << problem.observations.size() << '\n';
  for (const auto& o : problem.observations) {
    out << o.camera << ' ' << o.point << ' ' << o.u << ' ' << o.v << '\n';
  }
  for (const double x : problem.cameras) out << x << '\n';
  for (const double x : problem.points) out << x << '\n';
}

ceres::Solver::Summary solve(BalProblem& problem, bool dense) {
  ceres::Problem ceres_problem;
  for (const auto& o : problem.observations) {
    ceres_problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<SnavelyError, 2, 9, 3>(new SnavelyError{o.u, o.v}), nullptr,
        &problem.cameras[9 * static_cast<std::size_t>(o.camera)],
        &problem.points[3 * static_cast<std::size_t>(o.point)]);
  }
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (std::size_t i = 0; i < problem.points.size(); i += 3) {
    ordering->AddElementToGroup(&problem.points[i], 0);
  }
  for (std::size_t i = 0; i < problem.cameras.size(); i += 9) {
    ordering->AddElementToGroup(&problem.cameras[i], 1);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = dense ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  options.linear_solver_ordering = ordering;
  options.max_num_iterations = 60;
  options.function_tolerance = 1e-8;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  return summary;
}

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: ceres_bundle dense|sparse INPUT OUTPUT\n");
    return 2;
  }
  try {
    BalProblem problem = read(argv[2]);
    const double cpu = cpu_seconds();
    const ceres::Solver::Summary summary = solve(problem, std::string(argv[1]) == "dense");
    const double used = cpu_seconds() - cpu;
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    write(argv[3], problem);
    std::printf(
        "{\"peer\": \"ceres\", \"iterations\": %zu, \"cpu_s\": %.6f, \"wall_s\": %.6f, "
        "\"peak_memory_mb\": %.1f}\n",
        summary.iterations.size() - 1, used, summary.total_time_in_seconds,
        static_cast<double>(usage.ru_maxrss) / 1024);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "ceres_bundle: %s\n", error.what());
    return 3;
  }
  return 0;
}
