#include "apps/python/session.h"

namespace hybrid_slam::python {
namespace {

std::optional<Eigen::Matrix4d> pose_of(const FrameResult& frame) {
  if (!frame.has_pose()) return std::nullopt;
  return to_matrix(frame.tracked.cam_from_world);
}

std::optional<std::uint32_t> id_or_none(KeyframeId id) {
  return id.valid() ? std::optional(id.value) : std::nullopt;
}

}  // namespace

void bind_frame_result(py::module_& module) {
  py::class_<FoundCause>(module, "Cause", "What may be wrong with a frame (docs/reliability.md).")
      .def_property_readonly(
          "name", [](const FoundCause& found) { return std::string(to_string(found.cause)); })
      .def_readonly("value", &FoundCause::value, "In the cause's own unit.")
      .def("__str__", [](const FoundCause& found) { return describe(found); });
  py::class_<FrameResult>(module, "FrameResult", "What became of one frame.")
      .def_property_readonly(
          "camera", [](const FrameResult& frame) { return std::string(to_string(frame.camera)); },
          "stereo or fisheye.")
      .def_readonly("time", &FrameResult::time, "[ns]")
      .def_readonly("index", &FrameResult::index,
                    "Of its moment: frames of both cameras at one time share it.")
      .def_property_readonly(
          "state", [](const FrameResult& frame) { return std::string(to_string(frame.state)); },
          "What the pose rests on: starting, map, odometry, relocalised or lost.")
      .def_property_readonly("has_pose", &FrameResult::has_pose)
      .def_property_readonly("cam_from_world", &pose_of,
                             "(4, 4) [m], as known at this moment; None without a pose.")
      .def_property_readonly(
          "world_from_cam",
          [](const FrameResult& frame) {
            return frame.has_pose()
                       ? std::optional(to_matrix(inverse(frame.tracked.cam_from_world)))
                       : std::nullopt;
          },
          "(4, 4) [m], or None.")
      .def_property_readonly(
          "covariance", [](const FrameResult& frame) { return Matrix6d(frame.tracked.covariance); },
          "(6, 6) of d in exp(d) cam_from_world, (translation, rotation) [m, rad] along the "
          "camera's axes.")
      .def_property_readonly(
          "ros_covariance",
          [](const FrameResult& frame) {
            return ros_covariance(
                inverse(UncertainMotion{frame.tracked.cam_from_world, frame.tracked.covariance}));
          },
          "(6, 6) of the pose in the world as ROS has it: x, y, z, turns about the world's axes "
          "[m, rad].")
      .def_property_readonly(
          "covariance_base",
          [](const FrameResult& frame) { return id_or_none(frame.tracked.covariance_base); },
          "The keyframe against which; None of a frame that is lost or starts the map.")
      .def_property_readonly(
          "left_from_fisheye",
          [](const FrameResult& frame) {
            return frame.left_from_fisheye
                       ? std::optional(to_matrix(frame.left_from_fisheye->b_from_a))
                       : std::nullopt;
          },
          "(4, 4) of a fisheye whose moment has a pair, where both have poses; else None.")
      .def_property_readonly(
          "left_from_fisheye_covariance",
          [](const FrameResult& frame) {
            return frame.left_from_fisheye ? std::optional(frame.left_from_fisheye->covariance)
                                           : std::nullopt;
          },
          "(6, 6), or None.")
      .def_readonly("causes", &FrameResult::causes,
                    "What may be wrong, whether it was tracked or not.")
      .def_readonly("features", &FrameResult::features)
      .def_readonly("stereo_matches", &FrameResult::stereo_matches)
      .def_property_readonly(
          "inliers", [](const FrameResult& frame) { return frame.tracked.inliers; },
          "Landmarks that agree with the pose.")
      .def_readonly("keyframes", &FrameResult::keyframes, "In the map that it was tracked in.")
      .def_readonly("landmarks", &FrameResult::landmarks)
      .def_property_readonly(
          "component", [](const FrameResult& frame) { return id_or_none(frame.component); },
          "Of the map that it has a pose in.")
      .def_readonly("mapping_behind", &FrameResult::mapping_behind,
                    "It could have become no keyframe: too many wait.");
}

}  // namespace hybrid_slam::python
