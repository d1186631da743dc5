#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/slam/replay.h"

namespace hybrid_slam {

// Of a moment's times and pixels, as they are pushed.
std::uint64_t checksum_of(const Moment& moment);

// Of all moments, in the order of time: XXH3 with 64 bits as 16 hexadecimal digits. The same images
// give the same, wherever they come from. 0 stands for a moment that was not read.
std::string checksum_of(const std::vector<std::uint64_t>& moments);

// A source that keeps a checksum of every moment as it is read: of times and pixels, after they
// were decoded and rectified. One thread.
class ChecksummedSource final : public FrameSource {
 public:
  explicit ChecksummedSource(const FrameSource& source)
      : source_(source), checksums_(source.size(), 0) {}

  std::size_t size() const override { return source_.size(); }
  Nanoseconds time(std::size_t index) const override { return source_.time(index); }
  CameraRig cameras() const override { return source_.cameras(); }
  Moment read(std::size_t index) const override;

  // Of all that was read.
  std::string checksum() const { return checksum_of(checksums_); }

 private:
  const FrameSource& source_;
  mutable std::vector<std::uint64_t> checksums_;  // by index; 0: not read
};

// The options that differ from the defaults: {"part.key": value as text}. Of text that
// write_slam_options() made. The kind of upsampling, which a run settles, is among them.
nlohmann::ordered_json changed_options(const std::string& options);

}  // namespace hybrid_slam
