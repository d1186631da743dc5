#pragma once

#include <memory>

#include "apps/slam/checkpoint_worker.h"
#include "apps/slam/observers.h"
#include "apps/slam/session_types.h"
#include "apps/slam/slam_options.h"
#include "backend/map/map.h"

namespace hybrid_slam {

// The SLAM behind a session: takes frames in the order of their times, makes the map of them. One
// thread at a time, but for map().
class SlamCore {
 public:
  virtual ~SlamCore() = default;

  virtual void take(CameraFrame frame) = 0;

  // What is under way ends; unless `cancelled`, loops that were found are closed and everything is
  // adjusted. Rethrows what one of its threads threw. Nothing is taken afterwards.
  virtual void finish(bool cancelled) = 0;

  // The newest; from any thread.
  virtual std::shared_ptr<const MapSnapshot> map() const = 0;

  // How long each stage took; after finish().
  virtual StageTimes times() const = 0;
};

// What a core is made of; the observers outlive it.
struct CoreSetUp {
  CameraRig cameras;
  SlamOptions options;
  SessionOptions session;
  SaveCheckpoint checkpoint;
  Observers& observers;
};

std::unique_ptr<SlamCore> make_every_frame_core(const CoreSetUp& set_up, Map map);
std::unique_ptr<SlamCore> make_realtime_core(const CoreSetUp& set_up, Map map);

}  // namespace hybrid_slam
