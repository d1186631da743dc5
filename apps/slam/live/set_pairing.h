#pragma once

#include <deque>
#include <string>
#include <vector>

#include "apps/slam/live/image_set.h"
#include "frontend/input/stamp_offset.h"

namespace hybrid_slam {

// What the stamps of images are.
enum class StampKind {
  kArrival,  // when they came: with what the way took, which differs from camera to camera
  kSensor,   // when they were taken, by clocks that may be apart by a constant
};

struct PairingOptions {
  StampKind stamps = StampKind::kArrival;
  bool right = true;              // false: left images hold both
  bool fisheye = false;           // there is one
  double tolerance = 0;           // of sensors' stamps: as match_stamps() takes it
  std::size_t most_waiting = 64;  // images per camera, for others that belong to them
};

// Brings images of separate cameras together as they come.
//
// By sensors' stamps as pair_stamps() does it with all of them; the fisheye's within 10 ms. By
// arrival: two images belong together if they come within half a frame period. That is clear where
// the cameras' difference is the same for nine images of ten, to a quarter of the period, and both
// it and its spread leave room to half a period; else it is refused. The first kSettling images of
// each camera settle that, or twice or four times as many where those were unclear, and are gone;
// later ones are looked at all the time. Images with
// sensors' stamps wait until it is settled: two pairs within half a millisecond do.
class SetPairing {
 public:
  // By chance, cameras that have nothing to do with one another would look clear in less than one
  // case of a hundred: 11 of 12 differences within half of all that there are.
  static constexpr std::size_t kSettling = 12;

  explicit SetPairing(const PairingOptions& options);

  // Each camera's stamps ascend.
  void add(LiveCamera camera, StampedImage image);

  // A camera that is away is not waited for.
  void set_away(LiveCamera camera, bool away);

  // The camera was away and is back: its offset may be another. The old one serves until it is
  // settled again.
  void restart(LiveCamera camera);

  // No more will come: with fewer images than wanted, those that are there settle it.
  void close() { closed_ = true; }

  // The next set that is whole. Throws InputError if it is unclear which images belong together;
  // until it is clear there are no sets.
  std::optional<ImageSet> take();

  // What was settled since the last call, one line each.
  std::vector<std::string> notes();

  bool settled() const { return started_; }
  std::size_t waiting(LiveCamera camera) const { return of(cameras_, camera).waiting.size(); }
  const PerCamera<std::int64_t>& alone() const { return alone_; }

 private:
  struct Camera {
    bool used = false;
    bool away = false;
    bool checked = false;             // its match is that of the newest images
    bool told = false;                // what it is
    std::size_t unchecked = 0;        // images since then
    std::optional<StampMatch> match;  // to the left camera
    std::deque<StampedImage> waiting;
    std::deque<std::int64_t> stamps;  // of the newest images
  };

  bool settle();
  bool settle_patiently();
  bool settle(LiveCamera camera);
  bool is_enough(const Stamps& left, const Stamps& other) const;
  StampMatch match_of(LiveCamera camera, const Stamps& left, const Stamps& other);
  StampMatch match_arrivals(LiveCamera camera, const Stamps& left, const Stamps& other);
  void leave_out(LiveCamera camera);
  void pair();
  bool add_fisheye(ImageSet& set);
  Camera& at(LiveCamera camera) { return of(cameras_, camera); }

  PairingOptions options_;
  PerCamera<Camera> cameras_;
  std::deque<ImageSet> pairs_;  // without their fisheye yet
  PerCamera<std::int64_t> alone_{};
  std::vector<std::string> notes_;
  std::size_t wanted_ = kSettling;  // images of each camera
  bool started_ = false;            // it was clear once
  bool closed_ = false;
};

}  // namespace hybrid_slam
