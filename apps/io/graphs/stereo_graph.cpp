#include "apps/io/graphs/stereo_graph.h"

#include <fmt/format.h>

#include <algorithm>
#include <unordered_map>

#include "apps/io/graphs/landmark_index.h"
#include "apps/io/graphs/text_scanner.h"
#include "cameras/files/output_file.h"
#include "frontend/input/pose_rows.h"

namespace hybrid_slam {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view kFactors = "stereo_factors";
constexpr std::uint64_t kMaxId = UINT32_MAX;

struct StereoGraphPaths {
  fs::path calibration, poses, factors;
};

StereoGraphPaths find_files(const fs::path& factors) {
  const std::string name = factors.filename().string();
  const std::size_t at = name.find(kFactors);
  const std::string before = name.substr(0, at);
  const std::string after = name.substr(at + kFactors.size());
  const fs::path folder = factors.parent_path();
  StereoGraphPaths paths{folder / (before + "calibration" + after),
                         folder / (before + "camera_poses" + after), factors};
  std::error_code ignored;
  if (!fs::exists(paths.calibration, ignored)) {
    paths.calibration = folder / (before + "calibration.txt");
  }
  return paths;
}

fs::path only_factors_in(const fs::path& folder) {
  std::vector<fs::path> found;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (is_stereo_factors(entry.path())) found.push_back(entry.path());
  }
  if (found.size() == 1) return found.front();
  std::sort(found.begin(), found.end());
  throw InputError(folder.string() + ": " +
                   (found.empty() ? "holds neither a COLMAP model nor stereo factors"
                                  : "holds several problems; name one, such as " +
                                        found.front().filename().string()));
}

Calibrated<RectifiedStereo> read_calibration(const fs::path& path) {
  TextScanner in(path);
  in.more();
  double v[6];
  for (double& value : v) value = in.number("one of fx fy s cx cy baseline");
  if (!(v[0] > 0) || !(v[1] > 0)) in.fail("the focal length must be positive");
  if (v[2] != 0) in.fail("a skew is not supported");
  if (!(v[5] > 0)) in.fail("the baseline must be positive");
  while (in.more_on_line()) in.number("number");  // some files hold more than is used
  in.expect_end_of_file();
  return {{v[0], v[1], v[3], v[4], v[5]}};
}

struct StereoGraphReader {
  GraphFile file;
  std::unordered_map<std::uint64_t, std::uint32_t> frames;  // by id

  void read_poses(const fs::path& path) {
    TextScanner in(path);
    while (in.more()) {
      const std::uint64_t id = in.integer("pose", kMaxId);
      if (!frames.emplace(id, static_cast<std::uint32_t>(frames.size())).second) {
        in.fail(fmt::format("pose {} is there already", id));
      }
      NumberRow row{in.line(), {}};
      for (int i = 0; i < 12; ++i) row.values.push_back(in.number("one of the 16 numbers"));
      for (const double expected : {0, 0, 0, 1}) {
        if (in.number("one of the 16 numbers") != expected) in.fail("the last row is not 0 0 0 1");
      }
      in.expect_end_of_line();
      GraphFrame frame;
      frame.cam_from_world = inverse(kitti_pose(row, path));
      frame.camera = 0;
      frame.fixed = file.graph.frames.empty();
      file.graph.frames.push_back(frame);
      file.frame_names.push_back(std::to_string(id));
    }
    if (frames.empty()) throw InputError(path.string() + ": holds no poses");
  }

  void read_factors(const fs::path& path) {
    TextScanner in(path);
    LandmarkIndex landmarks;
    ObservationSet seen;
    while (in.more()) {
      const std::uint64_t pose = in.integer("pose", kMaxId);
      const auto frame = frames.find(pose);
      if (frame == frames.end()) in.fail(fmt::format("there is no pose {}", pose));
      const std::uint64_t id = in.integer("landmark", kMaxId);
      const LandmarkIndex::Entry landmark = landmarks.insert(id);
      GraphObservation observation;
      observation.frame = frame->second;
      observation.point = landmark.index;
      if (!seen.insert(observation.frame, observation.point)) {
        in.fail(fmt::format("pose {} sees landmark {} twice", pose, id));
      }
      for (const int i : {0, 2, 1}) observation.measurement[i] = in.number("u_left, u_right or v");
      Eigen::Vector3d in_cam;
      for (double& value : in_cam) value = in.number("X, Y or Z");
      in.expect_end_of_line();
      if (landmark.is_new) {
        const Rigid3d& cam_from_world = file.graph.frames[observation.frame].cam_from_world;
        file.graph.points.push_back({inverse(cam_from_world) * in_cam});
      }
      file.graph.observations.push_back(observation);
    }
    if (file.graph.observations.empty()) throw InputError(path.string() + ": holds no factors");
    file.point_ids = landmarks.ids();
  }
};

void write_poses(const fs::path& path, const FactorGraph& graph,
                 const std::vector<std::string>& names) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  for (std::size_t i = 0; i < graph.frames.size(); ++i) {
    const Rigid3d world_from_cam = inverse(graph.frames[i].cam_from_world);
    const Eigen::Matrix3d rotation = world_from_cam.rotation().toRotationMatrix();
    fmt::format_to(out, "{}", names[i]);
    for (int row = 0; row < 3; ++row) {
      fmt::format_to(out, " {} {} {} {}", rotation(row, 0), rotation(row, 1), rotation(row, 2),
                     world_from_cam.translation()[row]);
    }
    fmt::format_to(out, " 0 0 0 1\n");
  }
  write_file(path, {text.data(), text.size()});
}

void write_factors(const fs::path& path, const FactorGraph& graph,
                   const std::vector<std::string>& names, const std::vector<std::uint64_t>& ids) {
  fmt::memory_buffer text;
  for (const GraphObservation& o : graph.observations) {
    const Eigen::Vector3d& uv = o.measurement;
    const Eigen::Vector3d in_cam =
        graph.frames[o.frame].cam_from_world * graph.points[o.point].in_world;
    fmt::format_to(std::back_inserter(text), "{} {} {} {} {} {} {} {}\n", names[o.frame],
                   ids[o.point], uv[0], uv[2], uv[1], in_cam[0], in_cam[1], in_cam[2]);
  }
  write_file(path, {text.data(), text.size()});
}

}  // namespace

bool is_stereo_factors(const fs::path& path) {
  return path.extension() == ".txt" && path.filename().string().find(kFactors) != std::string::npos;
}

GraphFile read_stereo_graph(const fs::path& path) {
  std::error_code ignored;
  const StereoGraphPaths paths =
      find_files(fs::is_directory(path, ignored) ? only_factors_in(path) : path);
  StereoGraphReader reader;
  reader.file.format = GraphFormat::kStereoGraph;
  reader.file.graph.cameras.push_back({read_calibration(paths.calibration)});
  reader.read_poses(paths.poses);
  reader.read_factors(paths.factors);
  GraphFile file = std::move(reader.file);
  file.writers.push_back(
      {GraphFormat::kStereoGraph,
       [paths, names = file.frame_names, ids = file.point_ids,
        calibration = read_file(paths.calibration)](const FactorGraph& graph, const fs::path& out) {
         const fs::path folder = make_folder(out / "optimized");
         write_file(folder / paths.calibration.filename(), calibration);
         write_poses(folder / paths.poses.filename(), graph, names);
         write_factors(folder / paths.factors.filename(), graph, names, ids);
         return folder;
       }});
  return file;
}

}  // namespace hybrid_slam
