#include "apps/python/map_view.h"

#include "backend/map/components.h"

namespace hybrid_slam::python {
namespace {

const Keyframe& keyframe_at(const MapView& map, std::uint32_t id) {
  const Keyframe* keyframe = map.snapshot->find(KeyframeId(id));
  if (keyframe == nullptr) throw py::key_error("the map has no keyframe " + std::to_string(id));
  return *keyframe;
}

py::array_t<std::uint32_t> ids_array(std::size_t count) {
  return py::array_t<std::uint32_t>(static_cast<py::ssize_t>(count));
}

template <typename Id>
py::array_t<std::uint32_t> to_ids(const std::vector<Id>& ids) {
  auto array = ids_array(ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i)
    array.mutable_at(static_cast<py::ssize_t>(i)) = ids[i].value;
  return array;
}

py::array_t<double> keyframe_poses(const MapView& map) {
  std::vector<Rigid3d> poses;
  for (const KeyframeId id : map.snapshot->keyframe_ids())
    poses.push_back(inverse(map.snapshot->at(id).cam_from_world));
  return to_array(poses);
}

Points3 landmark_positions(const MapView& map) {
  const auto ids = map.snapshot->landmark_ids();
  Points3 points(static_cast<Eigen::Index>(ids.size()), 3);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    points.row(static_cast<Eigen::Index>(i)) = map.snapshot->at(ids[i]).point_in_world.transpose();
  }
  return points;
}

// Which landmarks a keyframe sees, and where.
py::tuple observations(const MapView& map, std::uint32_t id) {
  const Keyframe& keyframe = keyframe_at(map, id);
  const FrameObservations& seen = *keyframe.observations;
  std::vector<LandmarkId> ids;
  std::vector<Eigen::Vector3d> rows;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!keyframe.landmarks[i].valid()) continue;
    const Keypoint& keypoint = seen.features.keypoints[i];
    ids.push_back(keyframe.landmarks[i]);
    rows.emplace_back(keypoint.x, keypoint.y,
                      seen.u_right.empty() ? kNoRightMatch : seen.u_right[i]);
  }
  Points3 pixels(static_cast<Eigen::Index>(rows.size()), 3);
  for (std::size_t i = 0; i < rows.size(); ++i)
    pixels.row(static_cast<Eigen::Index>(i)) = rows[i].transpose();
  return py::make_tuple(to_ids(ids), pixels);
}

py::tuple covisible(const MapView& map, std::uint32_t id, int min_shared) {
  keyframe_at(map, id);
  std::vector<KeyframeId> ids;
  std::vector<int> shared;
  for (const Covisible& edge :
       map.snapshot->covisible(KeyframeId(id), min_shared, map.snapshot->keyframe_count())) {
    ids.push_back(edge.id);
    shared.push_back(edge.shared_landmarks);
  }
  return py::make_tuple(to_ids(ids),
                        py::array_t<int>(static_cast<py::ssize_t>(shared.size()), shared.data()));
}

}  // namespace

void bind_map(py::module_& module) {
  py::class_<MapView>(module, "Map",
                      "A map at one moment. It does not change. World frame, metres.")
      .def_property_readonly("keyframe_count",
                             [](const MapView& map) { return map.snapshot->keyframe_count(); })
      .def_property_readonly("landmark_count",
                             [](const MapView& map) { return map.snapshot->landmark_count(); })
      .def_property_readonly(
          "component_count",
          [](const MapView& map) { return component_sizes(*map.snapshot).size(); },
          "Parts whose places against one another are not known.")
      .def_property_readonly(
          "program", [](const MapView& map) { return map.info.program; },
          "That made it, with its version.")
      .def_property_readonly(
          "options", [](const MapView& map) { return map.info.options; },
          "With which it was made: YAML.")
      .def_property_readonly("cameras",
                             [](const MapView& map) {
                               std::vector<AnyCamera> cameras;
                               for (std::uint32_t i = 0; i < map.snapshot->camera_count(); ++i)
                                 cameras.push_back({map.snapshot->camera(CameraId(i))});
                               return cameras;
                             })
      .def(
          "keyframe_ids", [](const MapView& map) { return to_ids(map.snapshot->keyframe_ids()); },
          "(K,) uint32, ascending.")
      .def("keyframe_poses", &keyframe_poses,
           "world_from_cam, (K, 4, 4), in the order of keyframe_ids().")
      .def(
          "keyframe_times",
          [](const MapView& map) {
            Eigen::VectorXd times(static_cast<Eigen::Index>(map.snapshot->keyframe_count()));
            Eigen::Index i = 0;
            for (const KeyframeId id : map.snapshot->keyframe_ids())
              times[i++] = map.snapshot->at(id).observations->time;
            return times;
          },
          "(K,) [s], in the order of keyframe_ids().")
      .def(
          "keyframe_cameras",
          [](const MapView& map) {
            auto cameras = ids_array(map.snapshot->keyframe_count());
            py::ssize_t i = 0;
            for (const KeyframeId id : map.snapshot->keyframe_ids())
              cameras.mutable_at(i++) = map.snapshot->at(id).observations->camera.value;
            return cameras;
          },
          "(K,) uint32: which of `cameras` made each, in the order of keyframe_ids().")
      .def(
          "landmark_ids", [](const MapView& map) { return to_ids(map.snapshot->landmark_ids()); },
          "(N,) uint32, ascending.")
      .def("landmarks", &landmark_positions, "Positions (N, 3), in the order of landmark_ids().")
      .def("observations", &observations, py::arg("keyframe"),
           "What a keyframe sees: ids of landmarks (M,), and (u, v, u_right) [px], (M, 3), u_right "
           "NaN without a match.")
      .def("covisible", &covisible, py::arg("keyframe"), py::arg("min_shared") = 15,
           "Keyframes that share landmarks, most first: ids (M,) and how many they share (M,).")
      .def(
          "keyframe_covariance",
          [](const MapView& map, std::uint32_t id) {
            return map.snapshot->keyframe_covariance(keyframe_at(map, id).id);
          },
          py::arg("keyframe"),
          "(6, 6) of the left perturbation of cam_from_world against the origin [m, rad], or None.")
      .def(
          "save",
          [](const MapView& map, const std::string& path) {
            save_map(path, *map.snapshot, map.info);
          },
          py::arg("path"), py::call_guard<py::gil_scoped_release>(),
          "Whole or not at all. Raises OutputError.");
  module.def(
      "load_map",
      [](const std::string& path) {
        LoadedMap loaded = load_map(path);
        return MapView{loaded.map.snapshot(), loaded.info};
      },
      py::arg("path"), py::call_guard<py::gil_scoped_release>(),
      "A map file (map.hslam). Raises InputError.");
}

}  // namespace hybrid_slam::python
