#pragma once

#include <CLI/CLI.hpp>
#include <memory>

#include "apps/scene_renderer/conditions.h"

namespace hybrid_slam {

// The options of a command line that set conditions. Those given take the place of the preset's.
class ConditionArguments {
 public:
  explicit ConditionArguments(CLI::App& app);  // adds the options
  ~ConditionArguments();

  // Throws CLI::ValidationError if a text cannot be read. Called once, after parsing.
  void check();

  void apply(Conditions& conditions) const;

 private:
  struct Given;

  std::unique_ptr<Given> given_;
};

}  // namespace hybrid_slam
