#include "apps/python/conversions.h"
#include "apps/slam/inputs.h"
#include "frontend/input/image_file.h"

namespace hybrid_slam::python {
namespace {

const std::map<std::string, SequenceLayout> kLayouts{{"auto", SequenceLayout::kAuto},
                                                     {"kitti", SequenceLayout::kKitti},
                                                     {"euroc", SequenceLayout::kEuroc},
                                                     {"uwslam", SequenceLayout::kUwslam},
                                                     {"4seasons", SequenceLayout::kFourSeasons}};
const std::map<std::string, SequenceCameras> kCameras{{"auto", SequenceCameras::kAuto},
                                                      {"stereo", SequenceCameras::kStereo},
                                                      {"hybrid", SequenceCameras::kHybrid}};
const std::map<std::string, GrayChannel> kChannels{{"grey", GrayChannel::kGrey},
                                                   {"red", GrayChannel::kRed},
                                                   {"green", GrayChannel::kGreen},
                                                   {"blue", GrayChannel::kBlue}};

// One moment of a sequence in Python.
struct FrameView {
  std::int64_t index = 0;
  Nanoseconds time = 0;
  py::object left, right, fisheye;
  std::string fisheye_error;
};

FrameView read_frame(const ImageSequence& sequence, py::ssize_t index) {
  const auto size = static_cast<py::ssize_t>(sequence.size());
  if (index < 0) index += size;
  if (index < 0 || index >= size)
    throw py::index_error("the sequence has " + std::to_string(size) + " frames");
  FrameImages images;
  {
    const py::gil_scoped_release release;
    images = sequence.read(static_cast<std::size_t>(index));
  }
  FrameView view{images.frame_index,
                 to_nanoseconds(images.time),
                 to_array(std::move(images.left)),
                 to_array(std::move(images.right)),
                 py::none(),
                 std::move(images.fisheye_error)};
  if (!images.fisheye.empty()) view.fisheye = to_array(std::move(images.fisheye));
  return view;
}

std::shared_ptr<ImageSequence> open(const std::string& path, const std::string& layout,
                                    const std::string& sequence, const std::string& cameras,
                                    const std::string& channel, int white, double pair_tolerance) {
  InputOptions options;
  options.images = {to_enum("channel", kChannels, channel), white};
  options.pair_tolerance = pair_tolerance;
  const auto kind = to_enum("layout", kLayouts, layout);
  const auto which = to_enum("cameras", kCameras, cameras);
  const py::gil_scoped_release release;
  return open_sequence(path, kind, sequence, which, TruthConvention::kAuto, options);
}

void bind_sequence(py::module_& module) {
  py::class_<FrameView>(module, "Frame",
                        "One moment of a sequence. Images are grey, (height, width), uint8.")
      .def_readonly("index", &FrameView::index)
      .def_readonly("time", &FrameView::time, "[ns]")
      .def_readonly("left", &FrameView::left)
      .def_readonly("right", &FrameView::right)
      .def_readonly("fisheye", &FrameView::fisheye,
                    "Raw; None without one, or if it cannot be read.")
      .def_readonly("fisheye_error", &FrameView::fisheye_error,
                    "Why it cannot be read; else empty.");
  py::class_<ImageSequence, std::shared_ptr<ImageSequence>>(
      module, "Sequence",
      "A sequence of a dataset: a sequence of Frame, decoded when they are asked for.")
      .def_property_readonly("name", [](const ImageSequence& s) { return s.info().name; })
      .def_property_readonly(
          "layout", [](const ImageSequence& s) { return s.info().layout; },
          "kitti, euroc, uwslam or 4seasons.")
      .def_property_readonly("rig",
                             [](const ImageSequence& s) {
                               return CameraRig{s.info().stereo, s.info().fisheye};
                             })
      .def_property_readonly(
          "times",
          [](const ImageSequence& s) {
            return Eigen::Map<const Eigen::VectorXd>(s.info().times.data(),
                                                     static_cast<Eigen::Index>(s.size()))
                .eval();
          },
          "(N,) of the frames [s].")
      .def_property_readonly(
          "truth", [](const ImageSequence& s) { return Path{s.info().truth}; },
          "The left camera's true path; empty where the dataset has none.")
      .def_property_readonly("fisheye_truth",
                             [](const ImageSequence& s) { return Path{s.info().fisheye_truth}; })
      .def_property_readonly("truth_has_rotation",
                             [](const ImageSequence& s) { return s.info().truth_has_rotation; })
      .def_property_readonly("warnings", [](const ImageSequence& s) { return s.info().warnings; })
      .def("__len__", &ImageSequence::size)
      .def("__getitem__", &read_frame, py::arg("index"),
           "Reads a frame. Raises InputError where an image is missing or damaged.");
  module.def("open_sequence", &open, py::arg("path"), py::kw_only(), py::arg("layout") = "auto",
             py::arg("sequence") = "", py::arg("cameras") = "auto", py::arg("channel") = "grey",
             py::arg("white") = 0, py::arg("pair_tolerance") = 0.0,
             "Opens a sequence of the dataset at `path`: KITTI, EuRoC or UWslam. `cameras`: auto, "
             "stereo or hybrid. "
             "`pair_tolerance` [s]: how far apart the images of a pair may be, 0: found. Raises "
             "InputError.");
}

}  // namespace

void bind_input(py::module_& module) {
  py::class_<CameraRig>(module, "CameraRig",
                        "The cameras of a vehicle: a stereo pair, and a fisheye or none.")
      .def(py::init([](const AnyCamera& stereo, const std::optional<AnyCamera>& fisheye) {
             CameraRig rig{camera_of<RectifiedStereo>(stereo, "stereo"), std::nullopt};
             if (fisheye) rig.fisheye = camera_of<KannalaBrandt>(*fisheye, "fisheye");
             return rig;
           }),
           py::arg("stereo"), py::arg("fisheye") = std::nullopt)
      .def_property_readonly("stereo", [](const CameraRig& rig) { return AnyCamera{rig.stereo}; })
      .def_property_readonly("fisheye", [](const CameraRig& rig) {
        return rig.fisheye ? std::optional(AnyCamera{*rig.fisheye}) : std::nullopt;
      });
  module.def(
      "read_image",
      [](const std::string& path, const std::string& channel, int white) {
        const ImageReading reading{to_enum("channel", kChannels, channel), white};
        GrayImage image;
        {
          const py::gil_scoped_release release;
          image = read_gray_image(path, reading);
        }
        return to_array(std::move(image));
      },
      py::arg("path"), py::kw_only(), py::arg("channel") = "grey", py::arg("white") = 0,
      "A PNG, JPEG, TIFF, PGM, PPM or BMP file as a grey image, (height, width) uint8. `channel` "
      "of a colour image: "
      "grey, red, green or blue; `white`: the sample that is white in more than 8 bits, 0: found. "
      "Raises InputError.");
  bind_sequence(module);
}

}  // namespace hybrid_slam::python
