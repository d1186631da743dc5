#include "apps/slam/live/live_run.h"

#include <chrono>
#include <deque>
#include <utility>

#include "apps/slam/log.h"
#include "apps/slam/recorded_run.h"
#include "frontend/input/stamp_offset.h"

namespace hybrid_slam {
namespace {

class LivePush {
 public:
  LivePush(SetSource& source, LiveCameras& cameras, const LiveOptions& live, SetRecorder* recorder,
           const std::function<void(const Moment&)>& accepted)
      : source_(source),
        cameras_(cameras),
        limit_(live.limit),
        stop_(live.stop),
        recorder_(recorder),
        accepted_(accepted),
        first_(std::make_move_iterator(cameras.first.begin()),
               std::make_move_iterator(cameras.first.end())) {
    cameras.first.clear();
  }

  void operator()(Session& session, Recorder& books) {
    source_.set_tell([&](const std::string& line) {
      log_of(LogRoom::kInput).info(line);
      books.failed({line});
    });
    for (std::size_t count = 0; limit_ == 0 || count < limit_; ++count) {
      std::optional<ImageSet> set = next();
      if (!set || !push(std::move(*set), session, books)) break;
    }
    source_.set_tell({});
  }

 private:
  std::optional<ImageSet> next() {
    if (first_.empty()) return source_.next(stop_);
    ImageSet set = std::move(first_.front());
    first_.pop_front();
    return set;
  }

  // False if the session takes no more.
  bool push(ImageSet set, Session& session, Recorder& books) {
    // Times are those that a reader gives to images of these names, so that a recording is replayed
    // to the same bytes.
    const Nanoseconds time = to_nanoseconds(seconds_of_stamp(set.left.stamp));
    const std::string complaint = cameras_.complaint(set);
    if (!complaint.empty()) {
      books.corrupt(time, complaint);
      return true;
    }
    if (!set.fisheye_error.empty()) books.fisheye_missing(time, set.fisheye_error);
    if (recorder_ != nullptr) {
      const std::string failure = recorder_->add(set);
      if (!failure.empty()) books.failed({failure});
    }
    cameras_.info.times.push_back(seconds_of_stamp(set.left.stamp));
    books.due(time, std::chrono::steady_clock::now());
    return push(moment_of(std::move(set), time), session);
  }

  Moment moment_of(ImageSet set, Nanoseconds time) const {
    if (cameras_.rectifier) {
      cameras_.rectifier->rectify_left(set.left.image);
      cameras_.rectifier->rectify_right(set.right.image);
    }
    Moment moment;
    moment.inputs.push_back(
        StereoImages{time, std::move(set.left.image), std::move(set.right.image)});
    if (set.fisheye) moment.inputs.push_back(FisheyeImage{time, std::move(set.fisheye->image)});
    return moment;
  }

  bool push(Moment moment, Session& session) {
    if (accepted_) accepted_(moment);
    for (SensorInput& input : moment.inputs) {
      if (session.push(std::move(input)) == PushResult::kClosed) return false;
    }
    return true;
  }

  SetSource& source_;
  LiveCameras& cameras_;
  const std::size_t limit_;
  const std::stop_token stop_;
  SetRecorder* const recorder_;
  const std::function<void(const Moment&)>& accepted_;
  std::deque<ImageSet> first_;
};

}  // namespace

RunResult run_live(SetSource& source, LiveCameras& cameras, const SlamOptions& options,
                   LiveOptions live, const ReplayHooks& hooks, SetRecorder* recorder,
                   const std::function<void(const Moment&)>& accepted, Map map) {
  live.session.drop = true;
  LivePush push(source, cameras, live, recorder, accepted);
  return recorded_run({cameras.info.stereo, cameras.info.fisheye}, options, std::move(live.session),
                      hooks, std::move(map), live.limit, std::ref(push));
}

}  // namespace hybrid_slam
