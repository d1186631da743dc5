#include <fmt/format.h>

#include <iterator>

#include "apps/io/graphs/colmap_model.h"
#include "apps/io/graphs/text_scanner.h"
#include "cameras/files/output_file.h"
#include "frontend/input/pose_rows.h"

namespace hybrid_slam {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view kCameraWord = "CAMERA";
constexpr std::string_view kImuWord = "IMU";

std::uint32_t read_id(TextScanner& in, std::string_view what) {
  return static_cast<std::uint32_t>(in.integer(what, UINT32_MAX));
}

std::uint64_t line_of(const TextScanner& in) { return static_cast<std::uint64_t>(in.line()); }

// qw qx qy qz tx ty tz.
Rigid3d read_pose(TextScanner& in) {
  double v[7];
  for (double& value : v) value = in.number("one of the pose's 7 numbers");
  const Eigen::Quaterniond rotation =
      checked_rotation(v[0], v[1], v[2], v[3], in.path(), in.line());
  return {rotation, Eigen::Vector3d(v[4], v[5], v[6])};
}

ColmapCameraKind find_kind(const TextScanner& in, std::string_view name) {
  std::string known;
  for (const ColmapCameraKind& kind : kColmapCameraKinds) {
    if (kind.name == name) return kind;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", kind.name);
  }
  in.fail(fmt::format("camera model {} is not supported: {} are", quote(name), known));
}

void read_cameras(ColmapModel& model) {
  TextScanner in(model.file("cameras"));
  while (in.more()) {
    ColmapCamera camera;
    camera.place = line_of(in);
    camera.id = read_id(in, "camera");
    camera.kind = find_kind(in, in.field("model"));
    camera.width = in.integer("width", INT32_MAX);
    camera.height = in.integer("height", INT32_MAX);
    for (std::size_t i = 0; i < camera.kind.params; ++i) {
      camera.params.push_back(in.number("parameter"));
    }
    in.expect_end_of_line();
    model.cameras.push_back(std::move(camera));
  }
}

// The second line of an image, which may be empty.
void read_points2d(TextScanner& in, std::vector<ColmapPoint2d>& points) {
  while (in.more_on_line()) {
    ColmapPoint2d point;
    point.pixel[0] = in.number("x");
    point.pixel[1] = in.number("y");
    if (in.skip_field("-1")) {
      point.point = ColmapPoint2d::kNoPoint;
    } else {
      point.point = in.integer("point", ColmapPoint2d::kNoPoint - 1);
    }
    points.push_back(point);
  }
}

void read_images(ColmapModel& model) {
  TextScanner in(model.file("images"));
  while (in.more()) {
    ColmapImage image;
    image.place = line_of(in);
    image.id = read_id(in, "image");
    image.cam_from_world = read_pose(in);
    image.camera = read_id(in, "camera");
    image.name = in.rest_of_line();
    if (image.name.empty()) in.fail("the image's name is missing");
    if (in.next_line()) read_points2d(in, image.points);
    model.images.push_back(std::move(image));
  }
}

void read_points(ColmapModel& model) {
  TextScanner in(model.file("points3D"));
  while (in.more()) {
    ColmapPoint point;
    point.place = line_of(in);
    point.id = in.integer("point", ColmapPoint2d::kNoPoint - 1);
    for (double& value : point.in_world) value = in.number("coordinate");
    for (std::uint8_t& value : point.color) {
      value = static_cast<std::uint8_t>(in.integer("color", 255));
    }
    point.error = in.number("error");
    while (in.more_on_line()) {
      ColmapTrackElement element;
      element.image = read_id(in, "image of the track");
      element.point = read_id(in, "point index of the track");
      point.track.push_back(element);
    }
    model.points.push_back(std::move(point));
  }
}

ColmapSensor read_sensor(TextScanner& in) {
  ColmapSensor sensor;
  const std::string_view type = in.field("sensor's type");
  if (type == kImuWord) {
    sensor.type = ColmapSensor::kImu;
  } else if (type != kCameraWord) {
    in.fail(fmt::format("sensor type {} is neither CAMERA nor IMU", quote(type)));
  }
  sensor.id = read_id(in, "sensor");
  return sensor;
}

void read_rigs(ColmapModel& model) {
  TextScanner in(model.file("rigs"));
  while (in.more()) {
    ColmapRig rig;
    rig.place = line_of(in);
    rig.id = read_id(in, "rig");
    const std::uint64_t sensors = in.integer("number of sensors");
    if (sensors > 0) rig.reference = read_sensor(in);
    for (std::uint64_t i = 1; i < sensors; ++i) {
      ColmapRigSensor other;
      other.sensor = read_sensor(in);
      if (in.integer("flag of the sensor's pose", 1) == 1) other.sensor_from_rig = read_pose(in);
      rig.others.push_back(other);
    }
    in.expect_end_of_line();
    model.rigs.push_back(std::move(rig));
  }
}

void read_frames(ColmapModel& model) {
  TextScanner in(model.file("frames"));
  while (in.more()) {
    ColmapFrame frame;
    frame.place = line_of(in);
    frame.id = read_id(in, "frame");
    frame.rig = read_id(in, "rig");
    frame.rig_from_world = read_pose(in);
    const std::uint64_t count = in.integer("number of data");
    for (std::uint64_t i = 0; i < count; ++i) {
      ColmapFrameData data;
      data.sensor = read_sensor(in);
      data.id = in.integer("data's id");
      frame.data.push_back(data);
    }
    in.expect_end_of_line();
    model.frames.push_back(std::move(frame));
  }
}

// Lines of one file, gathered.
class TextFile {
 public:
  template <typename... Args>
  void add(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Args>(args)...);
  }

  void add_pose(const Rigid3d& pose) {
    for (const int i : {3, 0, 1, 2, 4, 5, 6}) add(" {}", pose.params[i]);  // w x y z, translation
  }

  void add_sensor(const ColmapSensor& sensor) {
    add(" {} {}", sensor.type == ColmapSensor::kImu ? kImuWord : kCameraWord, sensor.id);
  }

  void write(const fs::path& path) const { write_file(path, {text_.data(), text_.size()}); }

 private:
  fmt::memory_buffer text_;
};

void write_cameras(const fs::path& folder, const ColmapModel& model) {
  TextFile out;
  out.add(
      "# Camera list with one line of data per camera:\n"
      "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n# Number of cameras: {}\n",
      model.cameras.size());
  for (const ColmapCamera& camera : model.cameras) {
    out.add("{} {} {} {}", camera.id, camera.kind.name, camera.width, camera.height);
    for (const double value : camera.params) out.add(" {}", value);
    out.add("\n");
  }
  out.write(folder / "cameras.txt");
}

void write_images(const fs::path& folder, const ColmapModel& model) {
  TextFile out;
  out.add(
      "# Image list with two lines of data per image:\n"
      "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
      "#   POINTS2D[] as (X, Y, POINT3D_ID)\n# Number of images: {}\n",
      model.images.size());
  for (const ColmapImage& image : model.images) {
    out.add("{}", image.id);
    out.add_pose(image.cam_from_world);
    out.add(" {} {}\n", image.camera, image.name);
    const char* separator = "";
    for (const ColmapPoint2d& point : image.points) {
      out.add("{}{} {} ", separator, point.pixel[0], point.pixel[1]);
      separator = " ";
      if (point.point == ColmapPoint2d::kNoPoint) {
        out.add("-1");
      } else {
        out.add("{}", point.point);
      }
    }
    out.add("\n");
  }
  out.write(folder / "images.txt");
}

void write_points(const fs::path& folder, const ColmapModel& model) {
  TextFile out;
  out.add(
      "# 3D point list with one line of data per point:\n"
      "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
      "# Number of points: {}\n",
      model.points.size());
  for (const ColmapPoint& point : model.points) {
    out.add("{} {} {} {} {} {} {} {}", point.id, point.in_world[0], point.in_world[1],
            point.in_world[2], point.color[0], point.color[1], point.color[2], point.error);
    for (const ColmapTrackElement& element : point.track) {
      out.add(" {} {}", element.image, element.point);
    }
    out.add("\n");
  }
  out.write(folder / "points3D.txt");
}

void write_rigs(const fs::path& folder, const ColmapModel& model) {
  TextFile out;
  out.add(
      "# Rig calib list with one line of data per calib:\n"
      "#   RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, SENSORS[] as (SENSOR_TYPE, "
      "SENSOR_ID, HAS_POSE, [QW, QX, QY, QZ, TX, TY, TZ])\n# Number of rigs: {}\n",
      model.rigs.size());
  for (const ColmapRig& rig : model.rigs) {
    out.add("{} {}", rig.id, rig.others.size() + (rig.reference ? 1 : 0));
    if (rig.reference) out.add_sensor(*rig.reference);
    for (const ColmapRigSensor& other : rig.others) {
      out.add_sensor(other.sensor);
      out.add(" {}", other.sensor_from_rig ? 1 : 0);
      if (other.sensor_from_rig) out.add_pose(*other.sensor_from_rig);
    }
    out.add("\n");
  }
  out.write(folder / "rigs.txt");
}

void write_frames(const fs::path& folder, const ColmapModel& model) {
  TextFile out;
  out.add(
      "# Frame list with one line of data per frame:\n"
      "#   FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, TZ], NUM_DATA_IDS, "
      "DATA_IDS[] as (SENSOR_TYPE, SENSOR_ID, DATA_ID)\n# Number of frames: {}\n",
      model.frames.size());
  for (const ColmapFrame& frame : model.frames) {
    out.add("{} {}", frame.id, frame.rig);
    out.add_pose(frame.rig_from_world);
    out.add(" {}", frame.data.size());
    for (const ColmapFrameData& data : frame.data) {
      out.add_sensor(data.sensor);
      out.add(" {}", data.id);
    }
    out.add("\n");
  }
  out.write(folder / "frames.txt");
}

}  // namespace

ColmapModel read_colmap_text(const fs::path& folder) {
  ColmapModel model;
  model.folder = folder;
  model.variant = ColmapVariant::kText;
  read_cameras(model);
  read_images(model);
  read_points(model);
  std::error_code ignored;
  model.has_rigs =
      fs::exists(model.file("rigs"), ignored) || fs::exists(model.file("frames"), ignored);
  if (model.has_rigs) {
    read_rigs(model);
    read_frames(model);
  }
  return model;
}

void write_colmap_text(const fs::path& folder, const ColmapModel& model) {
  write_cameras(folder, model);
  write_images(folder, model);
  write_points(folder, model);
  if (model.has_rigs) {
    write_rigs(folder, model);
    write_frames(folder, model);
  }
}

}  // namespace hybrid_slam
