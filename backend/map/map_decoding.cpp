#include "backend/map/map_decoding.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>
#include <variant>

#include "backend/map/byte_stream.h"
#include "backend/map/components.h"
#include "backend/map/covisibility.h"
#include "backend/map/landmark_attributes.h"
#include "backend/map/map_file_format.h"

namespace hybrid_slam {

namespace {

constexpr std::size_t kSingleSections = 3;  // info, cameras, state
constexpr std::uint32_t kOdometryVersion = 3;
constexpr std::uint32_t kDroppedVersion = 4;
constexpr std::uint32_t kCorrectionsVersion = 5;
constexpr std::size_t kNumbersPerKeypoint = 6;
constexpr std::uint32_t kMaxCount = 1'000'000'000;  // of frames: the sum of two is an int
constexpr double kMaxNormError = 1e-6;              // of a quaternion

double read_finite(ByteReader& in, const char* what) {
  const auto value = in.number<double>();
  if (!std::isfinite(value)) in.fail(std::string(what) + " is not finite");
  return value;
}

Eigen::Vector3d read_vector(ByteReader& in, const char* what) {
  Eigen::Vector3d vector;
  for (double& value : vector) value = read_finite(in, what);
  return vector;
}

Rigid3d read_pose(ByteReader& in) {
  Rigid3d pose;
  for (double& value : pose.params) value = read_finite(in, "pose");
  if (!(std::abs(pose.rotation().squaredNorm() - 1) < kMaxNormError)) {
    in.fail("pose whose quaternion is not of unit length");
  }
  return pose;
}

bool read_flag(ByteReader& in) {
  const auto flag = in.number<std::uint8_t>();
  if (flag > 1) in.fail("flag that is neither 0 nor 1");
  return flag == 1;
}

// The camera if the name is this model's, of which the parameters follow.
template <typename C>
void read_model(ByteReader& in, const std::string& name, std::optional<Camera>& camera) {
  if (name != C::Model::kName) return;
  C calibrated;
  calibrated.width = in.number<int>();
  calibrated.height = in.number<int>();
  // 0: not every calibration or graph file tells the size.
  if (calibrated.width < 0 || calibrated.height < 0) in.fail("camera of negative image size");
  if (in.number<std::uint32_t>() != calibrated.params.size()) {
    in.fail("camera with another number of parameters than its model's");
  }
  for (double& value : calibrated.params) value = read_finite(in, "camera parameter");
  camera = calibrated;
}

Camera read_camera(ByteReader& in) {
  const std::string name = in.text();
  std::optional<Camera> camera;
  [&]<std::size_t... kModel>(std::index_sequence<kModel...>) {
    (read_model<std::variant_alternative_t<kModel, Camera>>(in, name, camera), ...);
  }
  (std::make_index_sequence<std::variant_size_v<Camera>>());
  if (!camera) in.fail("camera of an unknown model");
  if (!(focal_length(*camera) > 0)) in.fail("camera without a focal length");
  return *camera;
}

void check(ByteReader& in, const Keypoint& keypoint) {
  for (const float value : {keypoint.x, keypoint.y, keypoint.scale, keypoint.angle,
                            keypoint.response, keypoint.sigma}) {
    if (!std::isfinite(value)) in.fail("keypoint that is not finite");
  }
  if (keypoint.scale < 0 || !(keypoint.sigma > 0)) in.fail("keypoint without a scale or a sigma");
}

// Of features; none in files that know of none.
std::uint32_t read_dropped(ByteReader& in, std::uint32_t version) {
  if (version < kDroppedVersion) return 0;
  const auto dropped = in.number<std::uint32_t>();
  if (dropped > kMaxCount) in.fail("more dropped features than an image can have");
  return dropped;
}

std::shared_ptr<const FrameObservations> read_frame(ByteReader& in, std::uint32_t version) {
  auto frame = std::make_shared<FrameObservations>();
  frame->camera = CameraId(in.number<std::uint32_t>());
  frame->frame_index = in.number<std::int64_t>();
  if (frame->frame_index < 0) in.fail("negative frame index");
  frame->time = read_finite(in, "time");
  const auto kind = in.number<std::uint8_t>();
  if (kind > static_cast<std::uint8_t>(DescriptorKind::kRootSift))
    in.fail("unknown kind of descriptor");
  FeatureSet& features = frame->features;
  features.kind = static_cast<DescriptorKind>(kind);
  const bool has_right = read_flag(in);
  const std::size_t count = in.count<std::uint32_t>(kNumbersPerKeypoint * sizeof(float) +
                                                    sizeof(Descriptor) + (has_right ? 4 : 0));
  features.keypoints.resize(count);
  for (const auto member : {&Keypoint::x, &Keypoint::y, &Keypoint::scale, &Keypoint::angle,
                            &Keypoint::response, &Keypoint::sigma}) {
    for (Keypoint& keypoint : features.keypoints) keypoint.*member = in.number<float>();
  }
  for (const Keypoint& keypoint : features.keypoints) check(in, keypoint);
  frame->u_right.resize(has_right ? count : 0);
  for (float& u : frame->u_right) {
    u = in.number<float>();
    if (std::isinf(u)) in.fail("right coordinate that is not finite");
  }
  features.descriptors.resize(count);
  for (Descriptor& descriptor : features.descriptors) {
    const std::string_view bytes = in.bytes(descriptor.size());
    std::copy(bytes.begin(), bytes.end(), descriptor.begin());
  }
  frame->dropped = read_dropped(in, version);
  return frame;
}

// In exact symmetry, as it was written.
Matrix6d read_covariance(ByteReader& in) {
  Matrix6d covariance;
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column <= row; ++column) {
      covariance(row, column) = covariance(column, row) = read_finite(in, "covariance");
    }
  }
  return covariance;
}

// Angles for which the images of the pair still show the same scene, one upright as the other.
constexpr double kMaxAngle = std::numbers::pi / 4;

double read_sigma(ByteReader& in, const char* what) {
  const double sigma = read_finite(in, what);
  if (sigma < 0) in.fail(std::string(what) + " has a negative standard deviation");
  return sigma;
}

std::optional<PairAlignment> read_rows(ByteReader& in) {
  if (!read_flag(in)) return std::nullopt;
  PairAlignment rows;
  for (double* const value : {&rows.pitch, &rows.roll, &rows.focal_ratio}) {
    *value = read_finite(in, "alignment of a pair");
    if (std::abs(*value) > kMaxAngle) in.fail("pair that cannot be aligned");
  }
  for (double* const sigma : {&rows.pitch_sigma, &rows.roll_sigma, &rows.focal_sigma}) {
    *sigma = read_sigma(in, "alignment of a pair");
  }
  const auto matches = in.number<std::uint32_t>();
  if (matches > kMaxCount) in.fail("more matches than a pair can have");
  rows.matches = static_cast<int>(matches);
  rows.row_rms = read_sigma(in, "alignment of a pair");
  rows.row_sigma = read_sigma(in, "alignment of a pair");
  return rows;
}

std::optional<FoundParameter> read_parameter(ByteReader& in) {
  if (!read_flag(in)) return std::nullopt;
  FoundParameter found;
  found.value = read_finite(in, "parameter");
  found.sigma = read_sigma(in, "parameter");
  if (!(found.sigma > 0)) in.fail("parameter without a standard deviation");
  found.systematic = read_sigma(in, "parameter");
  found.in_use = read_finite(in, "parameter");
  return found;
}

// Fills the tables section by section.
class MapDecoder {
 public:
  explicit MapDecoder(std::uint32_t version) : version_(version) {}

  void read(std::string_view section, ByteReader& in, MapFileInfo& info) {
    if (section == kInfoSection) {
      info.program = in.text();
      info.options = in.text();
    } else if (section == kCamerasSection) {
      while (!in.at_end()) tables_.cameras.push_back(read_camera(in));
    } else if (section == kStateSection) {
      read_state(in);
    } else if (section == kCorrectionsSection) {
      while (!in.at_end()) read_correction(in);
    } else if (section == kKeyframesSection) {
      while (!in.at_end()) read_keyframe(in);
    } else if (section == kOdometrySection) {
      while (!in.at_end()) read_odometry(in);
    } else if (section == kErasedSection) {
      while (!in.at_end()) read_erased(in);
    } else {
      while (!in.at_end()) read_landmark(in);
    }
    if (!in.at_end()) in.fail("holds more than it should");
  }

  MapTables finish(const ByteReader& end) {
    if (tables_.keyframes.size() != keyframes_ || tables_.erased.size() != erased_ ||
        tables_.landmarks.size() != landmarks_) {
      end.fail("keyframes or landmarks are missing");
    }
    if (tables_.corrections.size() != corrections_) end.fail("corrections are missing");
    if (odometry_ != 0) end.fail("odometry is missing, or too much of it");
    link_tree(end);
    covisibility_.write(tables_.keyframes);
    name_components(tables_);
    return std::move(tables_);
  }

 private:
  void read_state(ByteReader& in) {
    tables_.origin = KeyframeId(in.number<std::uint32_t>());
    tables_.next_keyframe = in.number<std::uint32_t>();
    tables_.next_landmark = in.number<std::uint32_t>();
    for (std::size_t camera = 0; camera < tables_.cameras.size(); ++camera) {
      const auto newest = in.number<std::int64_t>();
      if (newest < -1) in.fail("negative frame index");
      tables_.newest_frame_index.push_back(newest);
    }
    keyframes_ = in.number<std::uint32_t>();
    erased_ = in.number<std::uint32_t>();
    landmarks_ = in.number<std::uint32_t>();
    if (version_ >= kOdometryVersion) odometry_ = in.number<std::uint32_t>();
    if (version_ >= kCorrectionsVersion) corrections_ = in.number<std::uint32_t>();
    // Every keyframe that ever was is there, or left a tombstone.
    if (std::uint64_t{keyframes_} + erased_ != tables_.next_keyframe) {
      in.fail("keyframes that were neither kept nor erased");
    }
    if (tables_.origin.valid() != (keyframes_ > 0)) in.fail("origin without keyframes, or none");
  }

  // Each camera once, whatever the number of sections.
  void read_correction(ByteReader& in) {
    const CameraId camera(in.number<std::uint32_t>());
    if (camera.value >= tables_.cameras.size() || !(baseline(tables_.cameras[camera.value]) > 0)) {
      in.fail("correction of a camera that is no stereo pair");
    }
    RigCorrection correction;
    correction.rows = read_rows(in);
    correction.disparity = read_parameter(in);
    correction.shading = read_parameter(in);
    if (correction.empty() || !tables_.corrections.emplace(camera, correction).second) {
      in.fail("correction of nothing, or twice");
    }
  }

  // Ascending within a table, and below the next one to be given.
  std::uint32_t read_id(ByteReader& in, std::uint32_t& next, std::uint32_t end) {
    const auto id = in.number<std::uint32_t>();
    if (id < next || id >= end) in.fail("id out of order or out of range");
    next = id + 1;
    return id;
  }

  void read_keyframe(ByteReader& in) {
    const std::uint32_t id = read_id(in, next_keyframe_, tables_.next_keyframe);
    Keyframe& keyframe = tables_.keyframes.insert(id, {});
    keyframe.id = KeyframeId(id);
    keyframe.parent = KeyframeId(in.number<std::uint32_t>());
    keyframe.keep = read_flag(in);
    keyframe.cam_from_world = read_pose(in);
    keyframe.observations = read_frame(in, version_);
    const FrameObservations& frame = *keyframe.observations;
    if (frame.camera.value >= tables_.cameras.size()) in.fail("unknown camera");
    if (!frame.u_right.empty() && !(baseline(tables_.cameras[frame.camera.value]) > 0)) {
      in.fail("right coordinates of a camera that is no stereo pair");
    }
    if (frame.frame_index > tables_.newest_frame_index[frame.camera.value])
      in.fail("frame after the newest one");
    if (!kind_) kind_ = frame.features.kind;
    if (frame.features.kind != *kind_) in.fail("descriptors of several kinds");
    keyframe.landmarks.resize(frame.size());
  }

  void read_odometry(ByteReader& in) {
    const std::uint32_t id = read_id(in, next_odometry_, tables_.next_keyframe);
    if (tables_.keyframes.find(id) == nullptr) in.fail("odometry of an unknown keyframe");
    Odometry odometry;
    odometry.previous = KeyframeId(in.number<std::uint32_t>());
    odometry.motion.b_from_a = read_pose(in);
    odometry.motion.covariance = read_covariance(in);
    odometry.keypoints.resize(in.count<std::uint32_t>(sizeof(std::uint32_t)));
    for (std::uint32_t& keypoint : odometry.keypoints) keypoint = in.number<std::uint32_t>();
    odometry.dropped = read_dropped(in, version_);
    if (!is_valid(odometry, tables_.keyframes.find(id)->landmarks.size())) {
      in.fail("odometry without a covariance, or by keypoints that are not there");
    }
    tables_.keyframes.edit(id).odometry = std::make_shared<const Odometry>(std::move(odometry));
    --odometry_;
  }

  void read_erased(ByteReader& in) {
    const std::uint32_t id = read_id(in, next_erased_, tables_.next_keyframe);
    ErasedKeyframe& erased = tables_.erased.insert(id, {});
    erased.parent = KeyframeId(in.number<std::uint32_t>());
    erased.cam_from_parent = read_pose(in);
  }

  void read_landmark(ByteReader& in) {
    const std::uint32_t id = read_id(in, next_landmark_, tables_.next_landmark);
    Landmark& landmark = tables_.landmarks.insert(id, {});
    landmark.id = LandmarkId(id);
    landmark.point_in_world = read_vector(in, "point");
    landmark.reference = KeyframeId(in.number<std::uint32_t>());
    landmark.mean_direction = read_vector(in, "direction");
    landmark.object_scale = read_finite(in, "scale");
    for (int* const counter : {&landmark.visible, &landmark.found}) {
      const auto value = in.number<std::uint32_t>();
      if (value > kMaxCount) in.fail("counter out of range");
      *counter = static_cast<int>(value);
    }
    const std::size_t count = in.count<std::uint32_t>(2 * sizeof(std::uint32_t));
    if (count == 0) in.fail("landmark without observations");
    for (std::size_t i = 0; i < count; ++i) read_observation(in, landmark);
    update_appearance(tables_, landmark);
  }

  void read_observation(ByteReader& in, Landmark& landmark) {
    const KeyframeId id(in.number<std::uint32_t>());
    const auto keypoint = in.number<std::uint32_t>();
    const Keyframe* keyframe = tables_.keyframes.find(id.value);
    if (keyframe == nullptr || keypoint >= keyframe->landmarks.size()) {
      in.fail("observation by a keypoint that does not exist");
    }
    if (keyframe->landmarks[keypoint].valid()) in.fail("two landmarks at one keypoint");
    auto& others = landmark.observations;
    if (!others.empty() && !(others.back().keyframe < id)) in.fail("observations out of order");
    covisibility_.add(id, others, +1);
    others.push_back({id, keypoint});
    tables_.keyframes.edit(id.value).landmarks[keypoint] = landmark.id;
  }

  void link_tree(const ByteReader& end) {
    std::vector<std::pair<KeyframeId, KeyframeId>> links;
    tables_.keyframes.for_each([&](std::uint64_t, const Keyframe& keyframe) {
      if (keyframe.id != tables_.origin) links.emplace_back(keyframe.parent, keyframe.id);
    });
    for (const auto& [parent, child] : links) {
      if (tables_.keyframes.find(parent.value) == nullptr) end.fail("keyframe without a parent");
      tables_.keyframes.edit(parent.value).children.push_back(child);
    }
  }

  MapTables tables_;
  CovisibilityChanges covisibility_;
  std::optional<DescriptorKind> kind_;
  std::uint32_t version_;                                     // of the file
  std::uint32_t keyframes_ = 0, erased_ = 0, landmarks_ = 0;  // how many there shall be
  std::uint32_t corrections_ = 0;
  std::uint32_t odometry_ = 0;  // likewise, that are still to come
  std::uint32_t next_keyframe_ = 0, next_erased_ = 0, next_landmark_ = 0;  // least id to come
  std::uint32_t next_odometry_ = 0;
};

// The first kinds come once each, the others as often as it takes.
void check_order(const SectionFileReader& file) {
  const auto& sections = file.sections();
  std::size_t last = 0;
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const auto* const found =
        std::find(std::begin(kSectionOrder), std::end(kSectionOrder), sections[i].name);
    const auto kind = static_cast<std::size_t>(found - std::begin(kSectionOrder));
    const bool fits = i < kSingleSections ? kind == i : kind >= std::max(last, kSingleSections);
    if (found == std::end(kSectionOrder) || !fits) {
      ByteReader({}, file.place(i)).fail("not what should come here");
    }
    last = kind;
  }
}

}  // namespace

MapTables decode_map(SectionFileReader& file, MapFileInfo& info) {
  const ByteReader end({}, file.path().string());
  if (file.sections().size() < kSingleSections) end.fail("sections are missing");
  check_order(file);
  MapDecoder decoder(file.version());
  for (std::size_t i = 0; i < file.sections().size(); ++i) {
    const std::string content = file.read(i);
    ByteReader in(content, file.place(i));
    decoder.read(file.sections()[i].name, in, info);
  }
  return decoder.finish(end);
}

}  // namespace hybrid_slam
