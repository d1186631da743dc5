#include "backend/map/map_encoding.h"

#include <optional>
#include <variant>

#include "backend/map/byte_stream.h"
#include "backend/map/map_file_format.h"

namespace hybrid_slam {

namespace {

constexpr std::size_t kChunkSize = std::size_t{1} << 22;  // a section ends beyond it [bytes]

void write(ByteWriter& out, const Rigid3d& pose) {
  for (const double value : pose.params) out.number(value);
}

void write(ByteWriter& out, const Eigen::Vector3d& vector) {
  for (const double value : vector) out.number(value);
}

void write(ByteWriter& out, const Camera& camera) {
  out.text(model_name(camera));
  out.number(image_width(camera));
  out.number(image_height(camera));
  std::visit(
      [&](const auto& calibrated) {
        out.number(static_cast<std::uint32_t>(calibrated.params.size()));
        for (const double value : calibrated.params) out.number(value);
      },
      camera);
}

// Column by column: neighbours are alike, which compresses better.
void write(ByteWriter& out, const FrameObservations& frame) {
  out.number(frame.camera.value);
  out.number(frame.frame_index);
  out.number(frame.time);
  out.number(static_cast<std::uint8_t>(frame.features.kind));
  out.number(std::uint8_t{!frame.u_right.empty()});
  out.number(static_cast<std::uint32_t>(frame.size()));
  for (const auto member : {&Keypoint::x, &Keypoint::y, &Keypoint::scale, &Keypoint::angle,
                            &Keypoint::response, &Keypoint::sigma}) {
    for (const Keypoint& keypoint : frame.features.keypoints) out.number(keypoint.*member);
  }
  for (const float u : frame.u_right) out.number(u);
  for (const Descriptor& descriptor : frame.features.descriptors) {
    out.bytes({reinterpret_cast<const char*>(descriptor.data()), descriptor.size()});
  }
  out.number(frame.dropped);
}

// Landmarks, covisible keyframes and children follow from what else is written.
void write(ByteWriter& out, const Keyframe& keyframe) {
  out.number(keyframe.id.value);
  out.number(keyframe.parent.value);
  out.number(std::uint8_t{keyframe.keep});
  write(out, keyframe.cam_from_world);
  write(out, *keyframe.observations);
}

void write(ByteWriter& out, KeyframeId id, const Odometry& odometry) {
  out.number(id.value);
  out.number(odometry.previous.value);
  write(out, odometry.motion.b_from_a);
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column <= row; ++column) {
      out.number(odometry.motion.covariance(row, column));
    }
  }
  out.number(static_cast<std::uint32_t>(odometry.keypoints.size()));
  for (const std::uint32_t keypoint : odometry.keypoints) out.number(keypoint);
  out.number(odometry.dropped);
}

void write(ByteWriter& out, const std::optional<PairAlignment>& rows) {
  out.number(std::uint8_t{rows.has_value()});
  if (!rows) return;
  for (const double value : {rows->pitch, rows->roll, rows->focal_ratio, rows->pitch_sigma,
                             rows->roll_sigma, rows->focal_sigma}) {
    out.number(value);
  }
  out.number(static_cast<std::uint32_t>(rows->matches));
  out.number(rows->row_rms);
  out.number(rows->row_sigma);
}

void write(ByteWriter& out, const std::optional<FoundParameter>& found) {
  out.number(std::uint8_t{found.has_value()});
  if (!found) return;
  for (const double value : {found->value, found->sigma, found->systematic, found->in_use}) {
    out.number(value);
  }
}

// The descriptor is that of one of the observations and follows from them; the numbers would too,
// but only a machine that rounds alike finds the same ones again.
void write(ByteWriter& out, const Landmark& landmark) {
  out.number(landmark.id.value);
  write(out, landmark.point_in_world);
  out.number(landmark.reference.value);
  write(out, landmark.mean_direction);
  out.number(landmark.object_scale);
  out.number(landmark.visible);
  out.number(landmark.found);
  out.number(static_cast<std::uint32_t>(landmark.observations.size()));
  for (const Observation& observation : landmark.observations) {
    out.number(observation.keyframe.value);
    out.number(observation.keypoint);
  }
}

// The values of a table, in as many sections as it takes.
template <typename T, typename WriteOne>
void encode_table(const PersistentTable<T>& table, std::string_view section,
                  SectionFileWriter& file, WriteOne&& write_one) {
  ByteWriter out;
  const auto end_section = [&] {
    if (!out.content().empty()) file.add(section, out.content());
    out.clear();
  };
  table.for_each([&](std::uint64_t index, const T& value) {
    write_one(out, index, value);
    if (out.content().size() > kChunkSize) end_section();
  });
  end_section();
}

}  // namespace

void encode_map(const MapTables& tables, const MapFileInfo& info, SectionFileWriter& file) {
  ByteWriter texts;
  texts.text(info.program);
  texts.text(info.options);
  file.add(kInfoSection, texts.content());

  ByteWriter cameras;
  for (const Camera& camera : tables.cameras) write(cameras, camera);
  file.add(kCamerasSection, cameras.content());

  ByteWriter state;
  state.number(tables.origin.value);
  state.number(tables.next_keyframe);
  state.number(tables.next_landmark);
  for (const std::int64_t newest : tables.newest_frame_index) state.number(newest);
  for (const std::size_t size :
       {tables.keyframes.size(), tables.erased.size(), tables.landmarks.size()}) {
    state.number(static_cast<std::uint32_t>(size));
  }
  std::uint32_t odometry = 0;
  tables.keyframes.for_each(
      [&](std::uint64_t, const Keyframe& k) { odometry += k.odometry != nullptr ? 1 : 0; });
  state.number(odometry);
  state.number(static_cast<std::uint32_t>(tables.corrections.size()));
  file.add(kStateSection, state.content());

  ByteWriter corrections;
  for (const auto& [camera, correction] : tables.corrections) {
    corrections.number(camera.value);
    write(corrections, correction.rows);
    write(corrections, correction.disparity);
    write(corrections, correction.shading);
  }
  if (!corrections.content().empty()) file.add(kCorrectionsSection, corrections.content());

  encode_table(tables.keyframes, kKeyframesSection, file,
               [](ByteWriter& out, std::uint64_t, const Keyframe& k) { write(out, k); });
  encode_table(tables.keyframes, kOdometrySection, file,
               [](ByteWriter& out, std::uint64_t, const Keyframe& k) {
                 if (k.odometry != nullptr) write(out, k.id, *k.odometry);
               });
  encode_table(tables.erased, kErasedSection, file,
               [](ByteWriter& out, std::uint64_t index, const ErasedKeyframe& erased) {
                 out.number(static_cast<std::uint32_t>(index));
                 out.number(erased.parent.value);
                 write(out, erased.cam_from_parent);
               });
  encode_table(tables.landmarks, kLandmarksSection, file,
               [](ByteWriter& out, std::uint64_t, const Landmark& l) { write(out, l); });
}

}  // namespace hybrid_slam
