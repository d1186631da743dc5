// The mixed stream of test/benchmark/mixed_stream.h, for a comparison with peers:
//   mixed_stream_benchmark run [STEPS]           CPU time per update, cost, cost of the batch
//   optimum mixed_stream_benchmark write FILE [STEPS]    the same stream for a peer
//   mixed_stream_benchmark score FILE [STEPS]    the cost of the estimate that it wrote
// `run` and `score` print a line of JSON. 2,000 steps unless said otherwise.

#include <sys/resource.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <numeric>
#include <string>
#include <vector>

#include "backend/incremental/incremental_solver.h"
#include "backend/problem/solve_graph.h"
#include "test/backend/incremental/graph_feed.h"
#include "test/benchmark/mixed_stream.h"

namespace hybrid_slam {
namespace {

double cpu_milliseconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

class Feed {
 public:
  explicit Feed(MixedStream stream)
      : stream_(std::move(stream)), point_of_(stream_.graph.points.size()) {
    solver_.add_camera(stream_.graph.cameras[0].camera);
    for (const GraphBlock& block : stream_.graph.blocks) solver_.add_block(block);
    for (const std::uint32_t prior : stream_.prior_factors) add_factor(prior);
  }

  bool done() const { return next_ == stream_.steps.size(); }

  void add_next() {
    const FactorGraph& graph = stream_.graph;
    GraphFrame frame = graph.frames[next_];
    if (next_ > 0) {
      frame.cam_from_world = inverse(graph.edges[next_ - 1].a_from_b) * solver_.pose(next_ - 1);
    }
    solver_.add_pose(frame);
    if (next_ > 0) solver_.add_edge(graph.edges[next_ - 1]);
    const MixedStream::Step& step = stream_.steps[next_];
    for (const std::uint32_t point : step.points) {
      const Eigen::Vector3d in_cam = stream_.truth[next_] * graph.points[point].in_world;
      point_of_[point] = solver_.add_point(inverse(frame.cam_from_world) * in_cam);
    }
    for (const std::uint32_t factor : step.factors) add_factor(factor);
    ++next_;
  }

  IncrementalSolver& solver() { return solver_; }

 private:
  void add_factor(std::uint32_t index) {
    GraphFactor factor = stream_.graph.factors[index];
    for (GraphVariable& variable : factor.variables) {
      if (variable.kind == GraphVariable::Kind::kPoint) variable.index = point_of_[variable.index];
    }
    solver_.add_factor(factor);
  }

  MixedStream stream_;
  std::vector<std::uint32_t> point_of_;  // in the solver
  std::uint32_t next_ = 0;
  IncrementalSolver solver_{IncrementalOptions()};
};

int run(int steps) {
  Feed feed(mixed_stream(steps));
  std::vector<double> times;
  while (!feed.done()) {
    feed.add_next();
    const double start = cpu_milliseconds();
    feed.solver().update();
    times.push_back(cpu_milliseconds() - start);
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const FactorGraph graph = feed.solver().graph();
  std::printf(
      "{\"mean_cpu_ms\": %.4f, \"max_cpu_ms\": %.3f, \"cost\": %.9g, \"batch_cost\": %.9g, "
      "\"peak_memory_mb\": %.1f}\n",
      std::accumulate(times.begin(), times.end(), 0.0) / static_cast<double>(times.size()),
      *std::max_element(times.begin(), times.end()), cost(graph), batch_cost(graph),
      static_cast<double>(usage.ru_maxrss) / 1024);
  return 0;
}

int main_with(const std::vector<std::string>& words) {
  const bool is_run = words.size() > 1 && words[1] == "run";
  const std::size_t rest = is_run ? 2 : 3;
  if (words.size() < rest || words.size() > rest + 1) {
    std::fprintf(stderr, "usage: mixed_stream_benchmark run | write FILE | score FILE [STEPS]\n");
    return 2;
  }
  const int steps = words.size() > rest ? std::atoi(words[rest].c_str()) : 2000;
  if (is_run) return run(steps);
  MixedStream stream = mixed_stream(steps);
  if (words[1] == "write") {
    std::ofstream(words[2]) << stream_text(stream);
    return 0;
  }
  read_estimate(words[2], stream.graph);
  std::printf("{\"cost\": %.9g}\n", cost(stream.graph));
  return 0;
}

}  // namespace
}  // namespace hybrid_slam

int main(int argc, char** argv) {
  return hybrid_slam::main_with(std::vector<std::string>(argv, argv + argc));
}
