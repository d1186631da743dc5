#pragma once

#include <functional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace hybrid_slam {

// Of this program alone, beside ExitCode.
constexpr int kExitUnsound = 4;  // verify: the map was read, but something is wrong with it

// A verb of map_tool: what it does once the command line has been read. Returns the exit code.
using Verb = std::function<int()>;

// Throws InputError if the output is an input: that is never written to.
void check_output(const std::string& out, const std::vector<std::string>& inputs);

// Each adds its subcommand.
Verb add_info(CLI::App& app);
Verb add_verify(CLI::App& app);
Verb add_crop(CLI::App& app);
Verb add_export(CLI::App& app);
Verb add_merge(CLI::App& app);
Verb add_report(CLI::App& app);
Verb add_view(CLI::App& app);

}  // namespace hybrid_slam
