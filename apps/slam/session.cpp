#include "apps/slam/session.h"

#include <fmt/format.h>

#include <array>
#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>

#include "apps/slam/pose_history.h"
#include "apps/slam/session_log.h"
#include "apps/slam/slam_core.h"
#include "apps/slam/version.h"

namespace hybrid_slam {
namespace {

// What is known of the right camera by the map that the session goes on with.
std::optional<PairAlignment> known_alignment(const MapSnapshot& map, const CameraRig& cameras) {
  for (std::uint32_t i = 0; i < map.camera_count(); ++i) {
    if (map.camera(CameraId(i)) == Camera(cameras.stereo)) return map.correction(CameraId(i)).rows;
  }
  return std::nullopt;
}

FrameStreamOptions stream_options(const SessionOptions& session,
                                  std::optional<PairAlignment> known_alignment) {
  const bool realtime = session.mode == SessionMode::kRealtime;
  const Nanoseconds window = realtime ? 50'000'000 : 500'000'000;
  FrameStreamOptions stream;
  stream.reorder = {session.reorder_window > 0 ? session.reorder_window : window, realtime};
  stream.threads = session.threads;
  stream.drop = realtime && session.drop;
  stream.device = session.device;
  stream.known_alignment = known_alignment;
  return stream;
}

void require_valid(const SlamOptions& options) {
  const std::string error = options.validate();
  if (!error.empty()) throw std::invalid_argument("Session: " + error);
}

}  // namespace

// Frames come out of the stream in order; the core makes the map of them, in this one's thread; the
// observers are told.
class Session::Work {
 public:
  Work(const CameraRig& cameras, const SlamOptions& options, SessionOptions session,
       SessionObservers observers, Map map)
      : cameras_(cameras),
        options_(options),
        session_(std::move(session)),
        history_(session_.history),
        observers_(SessionLog::before(std::move(observers)),
                   session_.mode == SessionMode::kRealtime, inner()),
        core_((require_valid(options), make_core(std::move(map)))),
        stream_(cameras, options,
                stream_options(session_, known_alignment(*core_->map(), cameras))),
        thread_([this] { work(); }) {}

  ~Work() { cancel(); }

  PushResult push(SensorInput input) {
    const PushResult result = stream_.push(std::move(input));
    if (result == PushResult::kClosed) rethrow();
    return result;
  }

  std::optional<FrameResult> track(SensorInput input) {
    const std::pair key(camera_of(input), time_of(input));
    {
      const std::lock_guard lock(mutex_);
      awaited_ = key;
      result_.reset();
    }
    if (push(std::move(input)) != PushResult::kTaken) return std::nullopt;
    stream_.flush();
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return result_ || over_ || stream_.waiting() == 0; });
    if (failure_) std::rethrow_exception(failure_);
    return std::exchange(result_, std::nullopt);
  }

  void finish() {
    stream_.close();
    if (thread_.joinable()) thread_.join();
    rethrow();
    observers_.rethrow();
  }

  void cancel() {
    {
      const std::lock_guard lock(mutex_);
      cancelled_ = true;
    }
    stream_.cancel();
  }

  void reset() {
    const std::lock_guard lock(mutex_);
    reset_ = true;
  }

  std::shared_ptr<const MapSnapshot> map() const {
    const std::lock_guard lock(mutex_);
    return core_->map();
  }

  MapFileInfo file_info() const {
    SlamOptions options = options_;
    if (stream_.upsampling()) {
      options.upsampling = stream_.upsamples() ? Upsampling::kOn : Upsampling::kOff;
    }
    options.distribute();
    return {fmt::format("hybrid_slam {} ({})", kVersion, kGitCommit), write_slam_options(options)};
  }

  SessionCounts counts() const {
    return {stream_.counts(CameraKind::kStereo), stream_.counts(CameraKind::kFisheye),
            stream_.waiting(), observers_.overruns()};
  }

  StageTimes times() {
    StageTimes all = stream_.times();
    all.merge(core_->times());
    return all;
  }

  const CameraRig& cameras() const { return cameras_; }
  const PoseHistory& history() const { return history_; }
  const FrameStream& stream() const { return stream_; }

 private:
  std::unique_ptr<SlamCore> make_core(Map map) {
    SaveCheckpoint checkpoint;
    if (session_.checkpoint) {
      checkpoint = [this](const MapSnapshot& so_far) {
        return session_.checkpoint(so_far, file_info());
      };
    }
    const CoreSetUp set_up{cameras_, options_, session_, checkpoint, observers_};
    return session_.mode == SessionMode::kRealtime ? make_realtime_core(set_up, std::move(map))
                                                   : make_every_frame_core(set_up, std::move(map));
  }

  SessionObservers inner() {
    SessionObservers inner;
    inner.frame = [this](const FrameResult& frame) {
      history_.add(frame);
      const std::lock_guard lock(mutex_);
      if (awaited_ == std::pair(frame.camera, frame.time)) result_ = frame;
    };
    inner.keyframe = [this](const KeyframeResult& keyframe) { history_.became_keyframe(keyframe); };
    inner.map = [this](const std::shared_ptr<const MapSnapshot>& map, MapChange change) {
      if (change != MapChange::kKeyframe) observers_.corrected(history_.corrected(*map));
    };
    return inner;
  }

  void work() {
    try {
      while (auto item = stream_.next()) {
        for (const LeftOut& input : item->left_out) leave_out(input);
        if (item->frame) take(std::move(*item->frame));
        // Without it track() could look just before and wait just after.
        const std::lock_guard lock(mutex_);
        changed_.notify_all();
      }
      core_->finish(is_cancelled());
    } catch (...) {
      const std::lock_guard lock(mutex_);
      failure_ = std::current_exception();
    }
    stream_.cancel();
    observers_.finish();
    const std::lock_guard lock(mutex_);
    over_ = true;
    changed_.notify_all();
  }

  void leave_out(const LeftOut& input) {
    FrameEvidence& since = since_[static_cast<std::size_t>(input.camera)];
    since.late += input.reason == std::string_view(to_string(PushResult::kLate)) ? 1 : 0;
    since.dropped += input.reason == std::string_view(kDropped) ? 1 : 0;
    observers_.left_out(input);
  }

  void take(CameraFrame frame) {
    begin_anew_if_asked();
    const FrameEvidence since =
        std::exchange(since_[static_cast<std::size_t>(frame.camera)], FrameEvidence());
    frame.evidence.late = since.late;
    frame.evidence.dropped = since.dropped;
    core_->take(std::move(frame));
    stream_.done();
  }

  void begin_anew_if_asked() {
    {
      const std::lock_guard lock(mutex_);
      if (!std::exchange(reset_, false)) return;
    }
    core_->finish(true);
    auto core = make_core({});
    history_.clear();
    const std::lock_guard lock(mutex_);
    core_ = std::move(core);
  }

  bool is_cancelled() const {
    const std::lock_guard lock(mutex_);
    return cancelled_;
  }

  void rethrow() const {
    const std::lock_guard lock(mutex_);
    if (failure_) std::rethrow_exception(failure_);
  }

  const CameraRig cameras_;
  const SlamOptions options_;
  const SessionOptions session_;
  PoseHistory history_;

  mutable std::mutex mutex_;  // guards what is marked
  std::condition_variable changed_;
  std::optional<std::pair<CameraKind, Nanoseconds>> awaited_;  // guarded
  std::optional<FrameResult> result_;                          // guarded
  bool reset_ = false;                                         // guarded
  bool cancelled_ = false;                                     // guarded
  bool over_ = false;                                          // guarded
  std::exception_ptr failure_;                                 // guarded

  Observers observers_;
  std::unique_ptr<SlamCore> core_;  // the thread's own; others lock to read it, it to change it
  FrameStream stream_;
  std::array<FrameEvidence, 2> since_;  // the last frame, by camera; the thread's own
  std::jthread thread_;                 // last: joined before the rest goes
};

Session::Session(const CameraRig& cameras, const SlamOptions& options, SessionOptions session,
                 SessionObservers observers, Map map)
    : work_(std::make_unique<Work>(cameras, options, std::move(session), std::move(observers),
                                   std::move(map))) {}

Session::~Session() = default;

PushResult Session::push(SensorInput input) { return work_->push(std::move(input)); }

std::optional<FrameResult> Session::track(SensorInput input) {
  return work_->track(std::move(input));
}

void Session::finish() { work_->finish(); }
void Session::cancel() { work_->cancel(); }
void Session::reset() { work_->reset(); }
std::shared_ptr<const MapSnapshot> Session::map() const { return work_->map(); }
SessionCounts Session::counts() const { return work_->counts(); }
StageTimes Session::times() const { return work_->times(); }

std::optional<UpsamplingEvidence> Session::upsampling() const {
  return work_->stream().upsampling();
}

bool Session::upsamples() const { return work_->stream().upsamples(); }

std::optional<Rigid3d> Session::pose_at(CameraKind camera, Nanoseconds time) const {
  return work_->history().at(camera, time, *map());
}

std::vector<LandmarkId> Session::landmarks_in_view(CameraKind camera,
                                                   const Rigid3d& cam_from_world) const {
  const CameraRig& cameras = work_->cameras();
  if (camera == CameraKind::kFisheye && !cameras.fisheye) return {};
  const Camera model =
      camera == CameraKind::kStereo ? Camera(cameras.stereo) : Camera(*cameras.fisheye);
  const auto snapshot = map();
  std::vector<LandmarkId> seen;
  for (const LandmarkId id : snapshot->landmark_ids()) {
    const auto pixel = project(model, cam_from_world * snapshot->at(id).point_in_world);
    if (pixel && in_image(model, *pixel)) seen.push_back(id);
  }
  return seen;
}

MapFileInfo Session::file_info() const { return work_->file_info(); }

void Session::save(const std::filesystem::path& file) const {
  save_map(file, *map(), work_->file_info());
}

}  // namespace hybrid_slam
