#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apps/io/graphs/graph_file.h"

namespace hybrid_slam {

// The folder of the shared data; none, and a line that says so, where it is not at hand.
std::optional<std::filesystem::path> shared_graphs();

// One way to spoil a file, and what the reader must say of it.
struct Fault {
  std::string name;
  std::string from, to;  // the first `from` in the text becomes `to`
  std::string reason;    // part of the error line
};

// Spoils `text` in each way and checks that read_graph refuses the file with one line that begins
// with the file's name and holds the reason.
void check_faults(const std::string& file_name, const std::string& text,
                  const std::vector<Fault>& faults);

// The same with several files, by name, of which `spoiled` is spoiled; `input`, below their folder,
// is what is read.
using TextFiles = std::map<std::string, std::string>;
void check_faults(const TextFiles& files, const std::string& spoiled,
                  const std::filesystem::path& input, const std::vector<Fault>& faults);

// The reason, if read_graph refuses the path with one line; empty if it takes it.
std::string refusal(const std::filesystem::path& path);

// Writes the graph in its own format and reads it again: the same items, and the same cost to
// 1e-12.
void check_round_trip(const std::filesystem::path& path);

// Half the sum of squares, by the models and the transforms alone.
double reference_cost(const FactorGraph& graph);

}  // namespace hybrid_slam
