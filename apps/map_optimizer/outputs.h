#pragma once

#include <ctime>

#include <chrono>
#include <map>
#include <string>
#include <vector>

#include "apps/io/graphs/graph_errors.h"
#include "apps/map_optimizer/command_line.h"
#include "apps/map_optimizer/incremental.h"

namespace hybrid_slam {

// Seconds of each phase of the run, by the wall and by the processor.
class PhaseTimes {
 public:
  struct Phase {
    std::string name;
    double seconds = 0;
    double cpu_seconds = 0;
  };

  // Ends the present phase, under this name, and begins the next.
  void end(const std::string& name);

  const std::vector<Phase>& phases() const { return phases_; }

 private:
  std::vector<Phase> phases_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::clock_t cpu_start_ = std::clock();
};

// What came of a run.
struct OptimizerResult {
  FactorGraph graph;         // the file's, with the estimate
  OptimizerProblem problem;  // as it was solved
  PoseGraphStart start = PoseGraphStart::kGiven;
  GraphSummary solve;
  std::vector<UpdateRecord> updates;  // of an incremental run
  double initial_cost = 0;            // of the whole file, as it was read
  double final_cost = 0;
  std::map<std::string, ReprojectionError> initial_errors, final_errors;
};

// Throws InputError if the file cannot be written in the format that is asked for.
const GraphWriter& find_writer(const CommandLine& line, const GraphFile& file);

// The optimised graph, its trajectory where the file has times, and the updates of an incremental
// run. Throws OutputError.
void write_graph(const CommandLine& line, const GraphFile& file, const OptimizerResult& result);

// report.json. Throws OutputError.
void write_report(const CommandLine& line, const GraphFile& file, const OptimizerResult& result,
                  const PhaseTimes& times);

std::string to_string(SolveEnd end);

}  // namespace hybrid_slam
