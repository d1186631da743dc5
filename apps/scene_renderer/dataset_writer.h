#pragma once

#include <array>
#include <filesystem>
#include <string>

#include "apps/scene_renderer/sequence.h"

namespace hybrid_slam {

enum class ImageFormat { kJpeg, kPng };

// Writes a sequence in UWslam's layout (docs/datasets.md):
//   hybrid: FOLDER/hybrid/calibration, FOLDER/hybrid/NAME
//   survey: FOLDER/NAME with a calibration of its own
// With an arm or dirt, masks/ beside the images; with wrong cameras, true_cameras.json.
// scene.json is written last: a sequence that has one is whole.
class DatasetWriter {
 public:
  // Makes the folders and writes the calibration. Throws InputError if the sequence holds something
  // already, or other sequences beside it were made with another calibration; OutputError if
  // something cannot be written.
  DatasetWriter(const std::filesystem::path& folder, const std::string& name, ImageFormat format,
                const SceneOptions& options, const SceneCameras& cameras);

  void write(int frame, const RenderedFrame& images) const;

  // Times, truth and scene.json.
  void finish(const SceneSequence& sequence) const;

  const std::filesystem::path& sequence_folder() const { return sequence_; }

 private:
  void write_image(const std::string& name, const ColorImage& image) const;
  void write_mask(const std::string& name, const ColorImage& image,
                  const std::vector<std::uint8_t>& arm) const;
  void write_dirt(const SceneSequence& sequence) const;

  ImageFormat format_;
  bool hybrid_;
  std::filesystem::path sequence_, images_;
  std::array<std::string, 3> names_;  // of each camera's images, behind their number
};

}  // namespace hybrid_slam
