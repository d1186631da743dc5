#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "apps/view/http_server.h"

namespace hybrid_slam {

// A finished run to be played in a browser: its report, which asks for the image of the frame that
// is chosen.
class RunView {
 public:
  // `folder`: of a run's results. Images are shown where the dataset that it names is still there.
  // Throws InputError, AddressError.
  RunView(const std::filesystem::path& folder, const ServerOptions& options);
  ~RunView();

  void start();
  std::string url() const;

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace hybrid_slam
