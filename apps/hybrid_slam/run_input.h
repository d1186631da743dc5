#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "apps/slam/replay.h"

namespace hybrid_slam {

// Where the images of a run come from: files, or cameras.
class RunInput {
 public:
  virtual ~RunInput() = default;

  // The cameras, and what else is known; after run() all times, too.
  virtual const SequenceInfo& info() const = 0;
  virtual std::string opening() const = 0;  // a line for people

  // All of it, through a session. Once.
  virtual RunResult run(const SlamOptions& options, SessionOptions session,
                        const ReplayHooks& hooks, Map map) = 0;

  // After the run.
  virtual std::string checksum() const = 0;         // of the images: checksum_of()
  virtual std::string dataset() const = 0;          // where the images are, or came from
  virtual const ImageSequence* pictures() = 0;      // the images; null: they are not kept
  virtual nlohmann::ordered_json live() const = 0;  // of cameras: what came; of files: null
};

}  // namespace hybrid_slam
