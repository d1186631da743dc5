#include "apps/io/graphs/stereo_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <limits>

#include "apps/io/graphs/landmark_index.h"
#include "apps/io/graphs/text_scanner.h"
#include "cameras/files/output_file.h"
#include "frontend/input/pose_rows.h"

namespace hybrid_slam {

namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxCount = std::numeric_limits<std::uint32_t>::max() - 1;
constexpr std::uint64_t kKeyframeBytes = 30;    // at least, of a KF line
constexpr std::uint64_t kObservationBytes = 7;  // at least, of a line

struct StreamHeader {
  double f = 0, cx = 0, cy = 0, baseline = 0;
  double sigma = 0, odometry_rotation_sigma = 0, odometry_translation_sigma = 0;
  std::uint64_t keyframes = 0, landmarks = 0, observations = 0;
};

void expect_word(TextScanner& in, std::string_view word) {
  const std::string_view found = in.field(word);
  if (found != word) in.fail(fmt::format("expected {}, found {}", word, quote(found)));
}

double number_after(TextScanner& in, std::string_view word) {
  expect_word(in, word);
  return in.number(word);
}

std::uint64_t count_after(TextScanner& in, std::string_view word) {
  expect_word(in, word);
  return in.integer(word, kMaxCount);
}

StreamHeader read_header(TextScanner& in) {
  StreamHeader header;
  in.more();
  header.f = number_after(in, "CAM");
  header.cx = in.number("cx");
  header.cy = in.number("cy");
  header.baseline = in.number("baseline");
  header.sigma = number_after(in, "SIGMA_PX");
  header.odometry_rotation_sigma = number_after(in, "ODO_SIGMA_ROT");
  header.odometry_translation_sigma = number_after(in, "ODO_SIGMA_T");
  header.keyframes = count_after(in, "NKF");
  header.landmarks = count_after(in, "NLM");
  header.observations = count_after(in, "NOBS");
  in.expect_end_of_line();
  if (!(header.f > 0) || !(header.baseline > 0) || !(header.sigma > 0)) {
    in.fail("focal length, baseline and SIGMA_PX must be positive");
  }
  if (header.keyframes == 0) in.fail("there are no keyframes");
  in.expect_room_for(header.keyframes, kKeyframeBytes, "keyframes");
  in.expect_room_for(header.observations, kObservationBytes, "observations");
  return header;
}

struct StreamReader {
  explicit StreamReader(const fs::path& path) : in(path), header(read_header(in)) {}

  TextScanner in;
  StreamHeader header;
  GraphFile file;
  LandmarkIndex landmarks;
  std::vector<std::uint64_t> keyframe_ids;
  std::vector<char> has_place;  // by point: it was triangulated

  void read() {
    file.graph.cameras.push_back(
        {Calibrated<RectifiedStereo>{{header.f, header.f, header.cx, header.cy, header.baseline}}});
    for (std::uint64_t i = 0; i < header.keyframes; ++i) read_keyframe();
    in.expect_end_of_file();
    if (file.graph.observations.size() != header.observations) {
      in.fail(fmt::format("{} observations, where the header promises {}",
                          file.graph.observations.size(), header.observations));
    }
    file.point_ids = landmarks.ids();
    for (std::size_t i = 0; i < has_place.size(); ++i) {
      if (has_place[i] == 0) {
        in.fail(fmt::format("landmark {} never has a positive disparity", file.point_ids[i]));
      }
    }
  }

  void read_keyframe() {
    if (!in.more()) {
      in.fail(fmt::format("ends after {} keyframes, where the header promises {}",
                          file.graph.frames.size(), header.keyframes));
    }
    expect_word(in, "KF");
    const std::uint64_t id = in.integer("keyframe", kMaxCount);
    if (!keyframe_ids.empty() && id <= keyframe_ids.back()) {
      in.fail("the keyframes' numbers do not ascend");
    }
    keyframe_ids.push_back(id);
    expect_word(in, "GT");
    file.true_cam_from_world.push_back(inverse(read_pose()));
    add_frame();
    const std::uint64_t count = count_after(in, "N");
    in.expect_end_of_line();
    in.expect_room_for(count, kObservationBytes, "observations");
    ObservationSet seen;
    for (std::uint64_t i = 0; i < count; ++i) read_observation(seen);
  }

  // Behind GT: every keyframe but the first has an odometry.
  void add_frame() {
    const bool first = file.graph.frames.empty();
    Rigid3d previous_from_current;
    if (!first) {
      expect_word(in, "ODO");
      previous_from_current = read_pose();
    }
    GraphFrame frame;
    frame.cam_from_world =
        first ? file.true_cam_from_world.front()
              : inverse(previous_from_current) * file.graph.frames.back().cam_from_world;
    frame.camera = 0;
    frame.fixed = first;
    file.graph.frames.push_back(frame);
    file.previous_from_current.push_back(previous_from_current);
    file.times.push_back(static_cast<double>(keyframe_ids.back()));
    file.frame_names.push_back(std::to_string(keyframe_ids.back()));
  }

  Rigid3d read_pose() {
    double v[7];
    for (double& value : v) value = in.number("one of the pose's 7 numbers");
    const Eigen::Quaterniond rotation =
        checked_rotation(v[6], v[3], v[4], v[5], in.path(), in.line());
    return {rotation, Eigen::Vector3d(v[0], v[1], v[2])};
  }

  void read_observation(ObservationSet& seen) {
    if (!in.more()) in.fail("ends within the observations of a keyframe");
    if (header.landmarks == 0) in.fail("an observation, but there are no landmarks");
    const std::uint64_t id = in.integer("landmark", header.landmarks - 1);
    GraphObservation observation;
    observation.frame = static_cast<std::uint32_t>(file.graph.frames.size() - 1);
    observation.point = landmarks.insert(id).index;
    observation.sigma = header.sigma;
    if (!seen.insert(observation.frame, observation.point)) {
      in.fail(fmt::format("landmark {} is seen twice", id));
    }
    for (const int i : {0, 2, 1}) observation.measurement[i] = in.number("u_left, u_right or v");
    in.expect_end_of_line();
    place(observation);
    file.graph.observations.push_back(observation);
  }

  void place(const GraphObservation& observation) {
    if (observation.point == has_place.size()) {
      has_place.push_back(0);
      file.graph.points.emplace_back();
    }
    if (has_place[observation.point] != 0) return;
    const auto in_cam = triangulate_stereo(file.graph.cameras[0].camera, observation.measurement);
    if (!in_cam) return;
    file.graph.points[observation.point].in_world =
        inverse(file.graph.frames.back().cam_from_world) * *in_cam;
    has_place[observation.point] = 1;
  }
};

struct StreamWriter {
  StreamHeader header;
  std::vector<std::string> names;
  std::vector<std::uint64_t> landmark_ids;
  std::vector<Rigid3d> true_cam_from_world;
  std::string text = {};

  void append_pose(std::string_view word, const Rigid3d& pose) {
    text += ' ';
    text += word;
    for (const int i : {4, 5, 6, 0, 1, 2, 3}) {  // translation, quaternion x y z w
      fmt::format_to(std::back_inserter(text), " {}", pose.params[i]);
    }
  }

  void write(const fs::path& path, const FactorGraph& graph) {
    const auto out = std::back_inserter(text);
    fmt::format_to(out,
                   "CAM {} {} {} {} SIGMA_PX {} ODO_SIGMA_ROT {} ODO_SIGMA_T {} NKF {} NLM {} "
                   "NOBS {}\n",
                   header.f, header.cx, header.cy, header.baseline, header.sigma,
                   header.odometry_rotation_sigma, header.odometry_translation_sigma,
                   header.keyframes, header.landmarks, header.observations);
    auto next = graph.observations.begin();  // in the order of the frames, as it was read
    for (std::size_t i = 0; i < graph.frames.size(); ++i) {
      fmt::format_to(out, "KF {}", names[i]);
      append_pose("GT", inverse(true_cam_from_world[i]));
      if (i > 0) {
        append_pose("ODO",
                    graph.frames[i - 1].cam_from_world * inverse(graph.frames[i].cam_from_world));
      }
      const auto end =
          std::find_if(next, graph.observations.end(), [&](const auto& o) { return o.frame != i; });
      fmt::format_to(out, " N {}\n", end - next);
      for (; next != end; ++next) {
        const Eigen::Vector3d& uv = next->measurement;
        fmt::format_to(out, "{} {} {} {}\n", landmark_ids[next->point], uv[0], uv[2], uv[1]);
      }
    }
    write_file(path, text);
  }
};

}  // namespace

GraphFile read_stereo_stream(const fs::path& path) {
  StreamReader reader(path);
  reader.read();
  GraphFile file = std::move(reader.file);
  file.format = GraphFormat::kStereoStream;
  file.writers.push_back(
      {GraphFormat::kStereoStream,
       [header = reader.header, names = file.frame_names, ids = file.point_ids,
        truth = file.true_cam_from_world](const FactorGraph& graph, const fs::path& folder) {
         StreamWriter{header, names, ids, truth}.write(folder / "optimized.seq", graph);
         return folder / "optimized.seq";
       }});
  return file;
}

}  // namespace hybrid_slam
