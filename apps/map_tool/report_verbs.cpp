#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "apps/map_tool/verbs.h"
#include "apps/program/program.h"
#include "apps/report/report.h"
#include "apps/view/run_view.h"
#include "cameras/files/input_error.h"

namespace hybrid_slam {

Verb add_report(CLI::App& app) {
  struct Line {
    std::vector<std::string> inputs;
    std::string out;
  };
  const auto line = std::make_shared<Line>();
  CLI::App& verb = *app.add_subcommand("report", "a page to look at a map, or at a run's results");
  verb.add_option("MAP", line->inputs, "map files, or folders of results")
      ->option_text("MAP|DIR...")
      ->required()
      ->expected(1, 1000);
  verb.add_option("--out", line->out,
                  "the page to write, of one input (default: beside a map, MAP.html; in a folder, "
                  "report.html)")
      ->option_text("FILE");
  verb.callback([line] {
    if (line->inputs.size() > 1 && !line->out.empty()) {
      throw CLI::ValidationError("report: --out is for one input");
    }
  });
  return [line] {
    for (const std::string& input : line->inputs) {
      std::filesystem::path page = line->out;
      if (page.empty() && !std::filesystem::is_directory(input)) {
        page = std::filesystem::path(input).replace_extension(".html");
      }
      check_output(page.string(), {input});
      fmt::print("report     {}\n", report_of(input, page).string());
    }
    return static_cast<int>(kExitOk);
  };
}

Verb add_view(CLI::App& app) {
  struct Line {
    std::string folder;
    ServerOptions server;
  };
  const auto line = std::make_shared<Line>();
  CLI::App& verb = *app.add_subcommand("view", "plays a finished run in a browser, till Ctrl-C");
  verb.add_option("DIR", line->folder, "a folder of results")->required();
  verb.add_option("--port", line->server.port, "(default: 8417; 0: any that is free)")
      ->check(CLI::Range(0, 65535).description(""))
      ->option_text("PORT");
  verb.add_option("--address", line->server.address,
                  "address of this machine that serves it (default: 127.0.0.1, for this machine "
                  "alone)")
      ->option_text("ADDRESS");
  return [line] {
    if (!std::filesystem::is_directory(line->folder)) {
      throw InputError(line->folder + ": no folder of results");
    }
    try {
      RunView view(line->folder, line->server);
      watch_signals();
      view.start();
      fmt::print("{} is at {} till Ctrl-C\n", line->folder, view.url());
      std::fflush(stdout);
      while (!interrupted()) usleep(100'000);
    } catch (const AddressError& error) {
      spdlog::error("{}", error.what());
      return static_cast<int>(kExitBadUsage);
    }
    return static_cast<int>(kExitOk);
  };
}

}  // namespace hybrid_slam
