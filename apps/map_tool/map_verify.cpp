#include "apps/map_tool/map_verify.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "apps/map_tool/map_residuals.h"
#include "backend/map/map_decoding.h"
#include "backend/map/map_file_format.h"
#include "backend/map/odometry.h"

namespace hybrid_slam {
namespace {

constexpr double kThreshold2 = 5.991;
constexpr double kThreshold3 = 7.815;
constexpr double kChance = 1e-6;  // of a fault in a map that has none
constexpr double kUnitError = 1e-6;

// Residuals of one keyframe or landmark.
struct Judged {
  double chi2 = 0;
  double numbers = 0;
  std::size_t observations = 0;
  std::size_t beyond = 0;  // their threshold

  void add(const ViewResidual& residual, double level) {
    const double value = residual.chi2() / level;
    chi2 += value;
    numbers += residual.dimension;
    ++observations;
    beyond += value > (residual.dimension == 3 ? kThreshold3 : kThreshold2) ? 1 : 0;
  }

  // `unknowns` of their own; `others` there are that might have been faulty instead.
  bool beyond_chance(double unknowns, std::size_t others) const {
    const double degrees = numbers - unknowns;
    return degrees > 0 && 2 * beyond > observations &&
           chi2_tail_bound(chi2, degrees) * static_cast<double>(others) < kChance;
  }
};

class Verification {
 public:
  explicit Verification(const MapSnapshot& map) : map_(map) {}

  std::vector<std::string> run() {
    for (const KeyframeId id : map_.keyframe_ids()) check_pose(map_.at(id));
    check_components();
    check_residuals();
    return std::move(faults_);
  }

 private:
  template <typename... Args>
  void fault(fmt::format_string<Args...> format, Args&&... args) {
    faults_.push_back(fmt::format(format, std::forward<Args>(args)...));
  }

  void check_pose(const Keyframe& keyframe) {
    const double norm = keyframe.cam_from_world.rotation().norm();
    if (!(std::abs(norm - 1) < kUnitError)) {
      fault("keyframe {}: its rotation is not orthonormal: a quaternion of length {:.9g}",
            keyframe.id.value, norm);
    }
    std::size_t outside = 0;
    const Camera& camera = map_.camera(keyframe);
    for (const Keypoint& keypoint : keyframe.observations->features.keypoints) {
      outside += in_image(camera, Eigen::Vector2d(keypoint.x, keypoint.y)) ? 0 : 1;
    }
    if (outside > 0 && image_width(camera) > 0) {
      fault("keyframe {}: {} keypoints outside of its image of {}x{}", keyframe.id.value, outside,
            image_width(camera), image_height(camera));
    }
  }

  bool same_component(KeyframeId a, KeyframeId b) const {
    return map_.at(a).component == map_.at(b).component;
  }

  // Components are what measurements hold together, neither more nor less.
  void check_components() {
    std::map<KeyframeId, KeyframeId> above;  // disjoint sets by what was measured
    const auto root = [&](KeyframeId id) {
      while (above.at(id) != id) id = above.at(id) = above.at(above.at(id));
      return id;
    };
    for (const KeyframeId id : map_.keyframe_ids()) above.emplace(id, id);
    for (const KeyframeId id : map_.keyframe_ids()) {
      const Keyframe& keyframe = map_.at(id);
      for (const Covisible& other : keyframe.covisible) {
        above[root(id)] = root(other.id);
        if (id < other.id && !same_component(id, other.id)) {
          fault("keyframes {} and {}: share {} landmarks, but are in components {} and {}",
                id.value, other.id.value, other.shared_landmarks, keyframe.component.value,
                map_.at(other.id).component.value);
        }
      }
      if (keyframe.odometry == nullptr || is_loose(*keyframe.odometry)) continue;
      const KeyframeId previous = keyframe.odometry->previous;
      above[root(id)] = root(previous);
      if (!same_component(id, previous)) {
        fault("keyframes {} and {}: joined by odometry, but in components {} and {}",
              previous.value, id.value, map_.at(previous).component.value,
              keyframe.component.value);
      }
    }
    for (const KeyframeId id : map_.keyframe_ids()) {
      const KeyframeId name = map_.at(id).component;
      if (map_.find(name) == nullptr) {
        fault("keyframe {}: its component {} is not in the map", id.value, name.value);
      } else if (root(id) == id && root(name) != id) {
        fault("keyframe {}: nothing that was measured joins it with component {}", id.value,
              name.value);
      }
    }
  }

  void check_residuals() {
    std::vector<double> level(map_.camera_count(), 1);  // of squares
    const std::vector<ResidualSummary> cameras = residuals_by_camera(map_);
    for (std::size_t i = 0; i < level.size(); ++i) {
      const double robust = cameras[i].median / kMedianOfNormal;
      level[i] = std::max(1.0, robust * robust);
    }
    std::map<LandmarkId, Judged> landmarks;
    for (const KeyframeId id : map_.keyframe_ids()) {
      check_views(map_.at(id), level[map_.at(id).observations->camera.value], landmarks);
    }
    for (const auto& [id, judged] : landmarks) {
      if (!judged.beyond_chance(3, landmarks.size())) continue;
      fault(
          "landmark {}: {} of its {} observations are beyond chance: rms {:.1f} standard "
          "deviations",
          id.value, judged.beyond, judged.observations, std::sqrt(judged.chi2 / judged.numbers));
    }
  }

  void check_views(const Keyframe& keyframe, double level,
                   std::map<LandmarkId, Judged>& landmarks) {
    Judged all;
    std::size_t behind = 0;
    for (std::uint32_t k = 0; k < keyframe.landmarks.size(); ++k) {
      const LandmarkId id = keyframe.landmarks[k];
      if (!id.valid()) continue;
      const auto residual = residual_of(map_, keyframe, k);
      behind += residual ? 0 : 1;
      if (!residual) continue;
      all.add(*residual, level);
      landmarks[id].add(*residual, level);
    }
    if (behind > 0) {
      fault("keyframe {}: {} landmarks that it sees are not in front of its camera",
            keyframe.id.value, behind);
    }
    if (all.beyond_chance(6, map_.keyframe_count())) {
      fault(
          "keyframe {}: {} of its {} observations are beyond chance: rms {:.1f} standard "
          "deviations",
          keyframe.id.value, all.beyond, all.observations, std::sqrt(all.chi2 / all.numbers));
    }
  }

  static constexpr double kMedianOfNormal = 0.6745;  // of its absolute value

  const MapSnapshot& map_;
  std::vector<std::string> faults_;
};

}  // namespace

LoadedMap read_map_unchecked(const std::filesystem::path& path) {
  SectionFileReader file(path, kMapFileFormat);
  LoadedMap loaded;
  loaded.map = MapFileAccess::make(decode_map(file, loaded.info));
  return loaded;
}

// P(X >= x) <= (x / k)^(k / 2) exp((k - x) / 2), x > k.
double chi2_tail_bound(double chi2, double degrees) {
  if (!(chi2 > degrees)) return 1;
  return std::exp(0.5 * (degrees * std::log(chi2 / degrees) + degrees - chi2));
}

// Where references are broken nothing else can be looked at.
std::vector<std::string> map_faults(const Map& map) {
  std::vector<std::string> faults = map.check_consistency();
  if (faults.empty()) faults = Verification(map.view()).run();
  return faults;
}

}  // namespace hybrid_slam
