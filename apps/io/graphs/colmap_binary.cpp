#include <fmt/format.h>

#include "apps/io/graphs/binary_scanner.h"
#include "apps/io/graphs/colmap_model.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {

namespace {

namespace fs = std::filesystem;

constexpr double kMaxQuaternionError = 1e-2;

// qw qx qy qz tx ty tz.
Rigid3d read_pose(BinaryScanner& in) {
  const std::uint64_t start = in.at();
  double v[7];
  for (double& value : v) value = in.read<double>();
  const Eigen::Quaterniond rotation(v[0], v[1], v[2], v[3]);
  if (!(std::abs(rotation.norm() - 1) < kMaxQuaternionError)) {
    in.fail_at(start, "the quaternion is not of unit length");
  }
  return {rotation, Eigen::Vector3d(v[4], v[5], v[6])};
}

ColmapCameraKind read_kind(BinaryScanner& in) {
  const std::uint64_t start = in.at();
  const auto model = in.read<std::int32_t>();
  std::string known;
  for (const ColmapCameraKind& kind : kColmapCameraKinds) {
    if (static_cast<std::int32_t>(kind.model) == model) return kind;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", kind.name);
  }
  in.fail_at(start, fmt::format("camera model {} is not supported: {} are", model, known));
}

std::uint64_t read_size(BinaryScanner& in) {
  const auto size = in.read<std::uint64_t>();
  if (size > INT32_MAX) in.fail_at(in.at() - sizeof(size), "the image is too large");
  return size;
}

void read_cameras(ColmapModel& model) {
  BinaryScanner in(model.file("cameras"));
  const std::uint64_t count = in.count<std::uint64_t>(24, "cameras");
  for (std::uint64_t i = 0; i < count; ++i) {
    ColmapCamera camera;
    camera.place = in.at();
    camera.id = in.read<std::uint32_t>();
    camera.kind = read_kind(in);
    camera.width = read_size(in);
    camera.height = read_size(in);
    for (std::size_t k = 0; k < camera.kind.params; ++k) camera.params.push_back(in.read<double>());
    model.cameras.push_back(std::move(camera));
  }
  in.expect_end_of_file();
}

void read_images(ColmapModel& model) {
  BinaryScanner in(model.file("images"));
  const std::uint64_t count = in.count<std::uint64_t>(73, "images");
  for (std::uint64_t i = 0; i < count; ++i) {
    ColmapImage image;
    image.place = in.at();
    image.id = in.read<std::uint32_t>();
    image.cam_from_world = read_pose(in);
    image.camera = in.read<std::uint32_t>();
    image.name = in.text();
    const std::uint64_t points = in.count<std::uint64_t>(24, "points of an image");
    image.points.reserve(points);
    for (std::uint64_t k = 0; k < points; ++k) {
      ColmapPoint2d point;
      point.pixel[0] = in.read<double>();
      point.pixel[1] = in.read<double>();
      point.point = in.read<std::uint64_t>();
      image.points.push_back(point);
    }
    model.images.push_back(std::move(image));
  }
  in.expect_end_of_file();
}

void read_points(ColmapModel& model) {
  BinaryScanner in(model.file("points3D"));
  const std::uint64_t count = in.count<std::uint64_t>(51, "points");
  for (std::uint64_t i = 0; i < count; ++i) {
    ColmapPoint point;
    point.place = in.at();
    point.id = in.read<std::uint64_t>();
    for (double& value : point.in_world) value = in.read<double>();
    for (std::uint8_t& value : point.color) value = in.read<std::uint8_t>();
    point.error = in.read<double>();
    const std::uint64_t length = in.count<std::uint64_t>(8, "elements of a track");
    for (std::uint64_t k = 0; k < length; ++k) {
      ColmapTrackElement element;
      element.image = in.read<std::uint32_t>();
      element.point = in.read<std::uint32_t>();
      point.track.push_back(element);
    }
    model.points.push_back(std::move(point));
  }
  in.expect_end_of_file();
}

ColmapSensor read_sensor(BinaryScanner& in) {
  ColmapSensor sensor;
  const std::uint64_t start = in.at();
  sensor.type = in.read<std::int32_t>();
  if (sensor.type != ColmapSensor::kCamera && sensor.type != ColmapSensor::kImu) {
    in.fail_at(start, fmt::format("sensor type {} is neither camera nor IMU", sensor.type));
  }
  sensor.id = in.read<std::uint32_t>();
  return sensor;
}

void read_rigs(ColmapModel& model) {
  BinaryScanner in(model.file("rigs"));
  const std::uint64_t count = in.count<std::uint64_t>(8, "rigs");
  for (std::uint64_t i = 0; i < count; ++i) {
    ColmapRig rig;
    rig.place = in.at();
    rig.id = in.read<std::uint32_t>();
    const std::uint64_t sensors = in.count<std::uint32_t>(8, "sensors");
    if (sensors > 0) rig.reference = read_sensor(in);
    for (std::uint64_t k = 1; k < sensors; ++k) {
      ColmapRigSensor other;
      other.sensor = read_sensor(in);
      if (in.read<std::uint8_t>() != 0) other.sensor_from_rig = read_pose(in);
      rig.others.push_back(other);
    }
    model.rigs.push_back(std::move(rig));
  }
  in.expect_end_of_file();
}

void read_frames(ColmapModel& model) {
  BinaryScanner in(model.file("frames"));
  const std::uint64_t count = in.count<std::uint64_t>(68, "frames");
  for (std::uint64_t i = 0; i < count; ++i) {
    ColmapFrame frame;
    frame.place = in.at();
    frame.id = in.read<std::uint32_t>();
    frame.rig = in.read<std::uint32_t>();
    frame.rig_from_world = read_pose(in);
    const std::uint64_t data_count = in.count<std::uint32_t>(16, "data of a frame");
    for (std::uint64_t k = 0; k < data_count; ++k) {
      ColmapFrameData data;
      data.sensor = read_sensor(in);
      data.id = in.read<std::uint64_t>();
      frame.data.push_back(data);
    }
    model.frames.push_back(std::move(frame));
  }
  in.expect_end_of_file();
}

// Bytes of one file, gathered.
class BinaryFile {
 public:
  template <typename T>
  void add(T value) {
    static_assert(std::is_arithmetic_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
  }

  void add_text(std::string_view text) {
    bytes_ += text;
    bytes_ += '\0';
  }

  void add_pose(const Rigid3d& pose) {
    for (const int i : {3, 0, 1, 2, 4, 5, 6}) add(pose.params[i]);  // w x y z, translation
  }

  void add_sensor(const ColmapSensor& sensor) {
    add(sensor.type);
    add(sensor.id);
  }

  void add_count(std::size_t count) { add(std::uint64_t{count}); }

  void write(const fs::path& path) const { write_file(path, bytes_); }

 private:
  std::string bytes_;
};

void write_cameras(const fs::path& folder, const ColmapModel& model) {
  BinaryFile out;
  out.add_count(model.cameras.size());
  for (const ColmapCamera& camera : model.cameras) {
    out.add(camera.id);
    out.add(static_cast<std::int32_t>(camera.kind.model));
    out.add(camera.width);
    out.add(camera.height);
    for (const double value : camera.params) out.add(value);
  }
  out.write(folder / "cameras.bin");
}

void write_images(const fs::path& folder, const ColmapModel& model) {
  BinaryFile out;
  out.add_count(model.images.size());
  for (const ColmapImage& image : model.images) {
    out.add(image.id);
    out.add_pose(image.cam_from_world);
    out.add(image.camera);
    out.add_text(image.name);
    out.add_count(image.points.size());
    for (const ColmapPoint2d& point : image.points) {
      out.add(point.pixel[0]);
      out.add(point.pixel[1]);
      out.add(point.point);
    }
  }
  out.write(folder / "images.bin");
}

void write_points(const fs::path& folder, const ColmapModel& model) {
  BinaryFile out;
  out.add_count(model.points.size());
  for (const ColmapPoint& point : model.points) {
    out.add(point.id);
    for (const double value : point.in_world) out.add(value);
    for (const std::uint8_t value : point.color) out.add(value);
    out.add(point.error);
    out.add_count(point.track.size());
    for (const ColmapTrackElement& element : point.track) {
      out.add(element.image);
      out.add(element.point);
    }
  }
  out.write(folder / "points3D.bin");
}

void write_rigs(const fs::path& folder, const ColmapModel& model) {
  BinaryFile out;
  out.add_count(model.rigs.size());
  for (const ColmapRig& rig : model.rigs) {
    out.add(rig.id);
    out.add(static_cast<std::uint32_t>(rig.others.size() + (rig.reference ? 1 : 0)));
    if (rig.reference) out.add_sensor(*rig.reference);
    for (const ColmapRigSensor& other : rig.others) {
      out.add_sensor(other.sensor);
      out.add(static_cast<std::uint8_t>(other.sensor_from_rig ? 1 : 0));
      if (other.sensor_from_rig) out.add_pose(*other.sensor_from_rig);
    }
  }
  out.write(folder / "rigs.bin");
}

void write_frames(const fs::path& folder, const ColmapModel& model) {
  BinaryFile out;
  out.add_count(model.frames.size());
  for (const ColmapFrame& frame : model.frames) {
    out.add(frame.id);
    out.add(frame.rig);
    out.add_pose(frame.rig_from_world);
    out.add(static_cast<std::uint32_t>(frame.data.size()));
    for (const ColmapFrameData& data : frame.data) {
      out.add_sensor(data.sensor);
      out.add(data.id);
    }
  }
  out.write(folder / "frames.bin");
}

}  // namespace

ColmapModel read_colmap_binary(const fs::path& folder) {
  ColmapModel model;
  model.folder = folder;
  model.variant = ColmapVariant::kBinary;
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

void write_colmap_binary(const fs::path& folder, const ColmapModel& model) {
  write_cameras(folder, model);
  write_images(folder, model);
  write_points(folder, model);
  if (model.has_rigs) {
    write_rigs(folder, model);
    write_frames(folder, model);
  }
}

}  // namespace hybrid_slam
