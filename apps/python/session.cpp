#include "apps/python/session.h"

#include "apps/python/map_view.h"
#include "apps/slam/main_component.h"
#include "apps/slam/parallel_for.h"
#include "frontend/place_recognition/vocabulary_file.h"

namespace hybrid_slam::python {

const std::map<std::string, CameraKind> kCameraKinds{{"stereo", CameraKind::kStereo},
                                                     {"fisheye", CameraKind::kFisheye}};
const std::map<std::string, SessionMode> kModes{{"every-frame", SessionMode::kEveryFrame},
                                                {"realtime", SessionMode::kRealtime}};
const std::map<std::string, SiftDevice> kDevices{{"cpu", SiftDevice::kCpu},
                                                 {"cuda", SiftDevice::kCuda}};
const std::map<std::string, Upsampling> kUpsamplings{
    {"auto", Upsampling::kAuto}, {"on", Upsampling::kOn}, {"off", Upsampling::kOff}};

PythonSession::PythonSession(const CameraRig& cameras, const SlamOptions& options,
                             SessionOptions session, Map map)
    : session_(std::make_unique<Session>(cameras, options, std::move(session), observers(),
                                         std::move(map))) {}

PythonSession::~PythonSession() {
  const py::gil_scoped_release release;
  session_.reset();
}

SessionObservers PythonSession::observers() {
  SessionObservers observers;
  observers.frame = [this](const FrameResult& frame) { events_.try_push(frame); };
  observers.keyframe = [this](const KeyframeResult& keyframe) { events_.try_push(keyframe); };
  observers.failure = [this](const SessionFailure& failure) { events_.try_push(failure); };
  return observers;
}

// With the GIL: nobody else takes events.
void PythonSession::drain() {
  while (events_.size() > 0) {
    Event event = *events_.pop();
    if (auto* frame = std::get_if<FrameResult>(&event)) {
      recorder_.tracked(*frame);
      if (frame->has_pose()) {
        online_[static_cast<std::size_t>(frame->camera)].poses.push_back(
            {frame->tracked.time, inverse(frame->tracked.cam_from_world)});
      }
      if (unread_.size() == kKept) unread_.pop_front();
      unread_.push_back(std::move(*frame));
    } else if (const auto* keyframe = std::get_if<KeyframeResult>(&event)) {
      recorder_.became_keyframe(*keyframe);
    } else {
      failures_.push_back(std::get<SessionFailure>(event).text);
    }
  }
}

std::string PythonSession::push(SensorInput input) {
  drain();
  const py::gil_scoped_release release;
  return to_string(session_->push(std::move(input)));
}

std::optional<FrameResult> PythonSession::track(SensorInput input) {
  drain();
  const py::gil_scoped_release release;
  return session_->track(std::move(input));
}

void PythonSession::finish() {
  const py::gil_scoped_release release;
  session_->finish();
}

void PythonSession::save(const std::string& path) const {
  const py::gil_scoped_release release;
  session_->save(path);
}

std::vector<FrameResult> PythonSession::results() {
  drain();
  std::vector<FrameResult> results(std::make_move_iterator(unread_.begin()),
                                   std::make_move_iterator(unread_.end()));
  unread_.clear();
  return results;
}

std::vector<std::string> PythonSession::failures() {
  drain();
  return failures_;
}

Path PythonSession::trajectory(CameraKind camera, bool online) {
  drain();
  if (online) return online_[static_cast<std::size_t>(camera)];
  RunResult result = result_;
  result.map = session_->map();
  settle_components(result);
  Path path;
  for (const FrameRecord& record :
       camera == CameraKind::kStereo ? result.records : result.fisheye_records) {
    if (!record.frame.tracked() || !record.in_main) continue;
    path.poses.push_back({record.frame.time, inverse(result.cam_from_world(record))});
  }
  return path;
}

namespace {

StereoImages pair_of(Nanoseconds time, const py::array& left, const py::array& right,
                     const std::optional<py::array>& mask) {
  return {time, to_image(left, "left"), to_image(right, "right"),
          mask ? to_image(*mask, "mask") : GrayImage()};
}

FisheyeImage fisheye_of(Nanoseconds time, const py::array& image,
                        const std::optional<py::array>& mask) {
  return {time, to_image(image, "image"), mask ? to_image(*mask, "mask") : GrayImage()};
}

std::unique_ptr<PythonSession> make_session(const CameraRig& rig,
                                            const std::optional<SlamOptions>& options,
                                            const std::string& mode, int threads,
                                            const std::string& device, const std::string& map,
                                            bool localize, bool drop,
                                            const std::string& vocabulary) {
  SessionOptions session;
  session.mode = to_enum("mode", kModes, mode);
  session.threads = threads > 0 ? threads : default_thread_count();
  session.device = to_enum("device", kDevices, device);
  session.localize = localize;
  session.drop = drop;
  const py::gil_scoped_release release;
  if (!vocabulary.empty())
    session.vocabulary = load_vocabulary(vocabulary, DescriptorKind::kRootSift);
  SlamOptions settled = options.value_or(SlamOptions());
  settled.distribute();
  return std::make_unique<PythonSession>(rig, settled, std::move(session),
                                         map.empty() ? Map() : load_map(map).map);
}

py::dict counts_of(PythonSession& self) {
  const SessionCounts counts = self.session().counts();
  py::dict all;
  for (const auto& [name, camera] :
       {std::pair("stereo", counts.stereo), std::pair("fisheye", counts.fisheye)}) {
    py::dict one;
    one["taken"] = camera.taken;
    one["late"] = camera.late;
    one["duplicate"] = camera.duplicate;
    one["refused"] = camera.refused;
    one["dropped"] = camera.dropped;
    all[name] = one;
  }
  return all;
}

void bind_options(py::module_& module) {
  py::class_<SlamOptions>(
      module, "Options",
      "How the SLAM works. What is not named here is set in a YAML file (docs/options.md).")
      .def(
          py::init([](int features, std::uint64_t seed, bool loops, const std::string& upsampling) {
            SlamOptions options;
            options.features = features;
            options.seed = seed;
            options.loops.enabled = loops;
            options.upsampling = to_enum("upsampling", kUpsamplings, upsampling);
            options.distribute();
            if (const std::string fault = options.validate(); !fault.empty())
              throw std::invalid_argument(fault);
            return options;
          }),
          py::kw_only(), py::arg("features") = 2000, py::arg("seed") = 0, py::arg("loops") = true,
          py::arg("upsampling") = "auto", "`features` per image; `upsampling`: auto, on or off.")
      .def_static("read", &read_slam_options, py::arg("path"),
                  "A YAML file over the defaults. Raises InputError.")
      .def_readonly("features", &SlamOptions::features)
      .def_readonly("seed", &SlamOptions::seed)
      .def_property_readonly("loops",
                             [](const SlamOptions& options) { return options.loops.enabled; })
      .def(
          "to_yaml", [](const SlamOptions& options) { return write_slam_options(options); },
          "All options, as read() reads them.");
}

}  // namespace

void bind_session(py::module_& module) {
  bind_options(module);
  bind_frame_result(module);
  py::class_<PythonSession>(
      module, "Session",
      "The SLAM: images go in as the cameras give them, poses and the map come out.")
      .def(
          py::init(&make_session), py::arg("rig"), py::arg("options") = std::nullopt, py::kw_only(),
          py::arg("mode") = "realtime", py::arg("threads") = 0, py::arg("device") = "cpu",
          py::arg("map") = "", py::arg("localize") = false, py::arg("drop") = true,
          py::arg("vocabulary") = "",
          "`mode`: realtime, or every-frame (repeatable, bit for bit). `threads` that extract "
          "features, 0: one per core. `map`: a file to "
          "go on with, or with `localize` to track in. `drop`: in realtime who pushes too fast "
          "loses the oldest that wait. Images may come "
          "from any thread, in any order within the reordering window (50 ms; every-frame: 0.5 s).")
      .def(
          "push_stereo",
          [](PythonSession& self, Nanoseconds time, const py::array& left, const py::array& right,
             const std::optional<py::array>& mask) {
            return self.push(pair_of(time, left, right, mask));
          },
          py::arg("time"), py::arg("left"), py::arg("right"), py::arg("mask") = std::nullopt,
          "A rectified pair, (height, width) uint8, at `time` [ns]. Zero pixels of `mask` (of the "
          "left image) show nothing of the world. "
          "Says what became of it: taken, or why not. Waits for room unless frames are dropped.")
      .def(
          "push_fisheye",
          [](PythonSession& self, Nanoseconds time, const py::array& image,
             const std::optional<py::array>& mask) {
            return self.push(fisheye_of(time, image, mask));
          },
          py::arg("time"), py::arg("image"), py::arg("mask") = std::nullopt,
          "A raw image of the fisheye; as above.")
      .def(
          "track_stereo",
          [](PythonSession& self, Nanoseconds time, const py::array& left, const py::array& right,
             const std::optional<py::array>& mask) {
            return self.track(pair_of(time, left, right, mask));
          },
          py::arg("time"), py::arg("left"), py::arg("right"), py::arg("mask") = std::nullopt,
          "As push_stereo(), and waits for the result; what comes later must be of a later time. "
          "None if it was not taken.")
      .def(
          "track_fisheye",
          [](PythonSession& self, Nanoseconds time, const py::array& image,
             const std::optional<py::array>& mask) {
            return self.track(fisheye_of(time, image, mask));
          },
          py::arg("time"), py::arg("image"), py::arg("mask") = std::nullopt, "As track_stereo().")
      .def("finish", &PythonSession::finish,
           "Tracks what was pushed, closes loops, adjusts everything. Nothing is taken afterwards.")
      .def(
          "cancel", [](PythonSession& self) { self.session().cancel(); },
          "Ends with what there is; finish() then returns at once.")
      .def("results", &PythonSession::results,
           "Of the frames tracked since the last call; the newest 10000 are kept.")
      .def("failures", &PythonSession::failures,
           "What went wrong and did not end the session, a line each.")
      .def(
          "map",
          [](PythonSession& self) {
            return MapView{self.session().map(), self.session().file_info()};
          },
          "The newest map.")
      .def(
          "trajectory",
          [](PythonSession& self, const std::string& camera, bool online) {
            return self.trajectory(to_enum("camera", kCameraKinds, camera), online);
          },
          py::arg("camera") = "stereo", py::kw_only(), py::arg("online") = false,
          "Of all frames that were tracked, in the component with most of them, as the map has "
          "them now; `online`: as they were when each "
          "was tracked.")
      .def(
          "pose_at",
          [](PythonSession& self, const std::string& camera, Nanoseconds time) {
            const auto pose = self.session().pose_at(to_enum("camera", kCameraKinds, camera), time);
            return pose ? std::optional(to_matrix(inverse(*pose))) : std::nullopt;
          },
          py::arg("camera"), py::arg("time"),
          "world_from_cam (4, 4) at `time` [ns], between frames interpolated; None where it is not "
          "known.")
      .def("save", &PythonSession::save, py::arg("path"),
           "The newest map, whole or not at all. Raises OutputError.")
      .def("counts", &counts_of,
           "Of stereo and fisheye: inputs taken, late, duplicate, refused and dropped.");
}

}  // namespace hybrid_slam::python
