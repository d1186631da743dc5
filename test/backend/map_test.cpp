#include "backend/map/map.h"

#include <catch2/catch.hpp>

#include "test/support/filled_map.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

// Frames of one camera whose keypoints have no meaning: for tests of links alone.
class TinyMap {
 public:
  explicit TinyMap(bool stereo) : stereo_(stereo) {
    if (stereo) {
      map.add_camera(synthetic_stereo_camera(0.1));
    } else {
      map.add_camera(synthetic_fisheye_camera());
    }
  }

  NewKeyframe frame(std::size_t keypoints) {
    auto observations = std::make_shared<FrameObservations>();
    observations->camera = CameraId(0);
    observations->features.kind = DescriptorKind::kSynthetic;
    for (std::size_t i = 0; i < keypoints; ++i) {
      observations->features.keypoints.push_back({100, 100, 2, 0, 5, 1});
      observations->features.descriptors.emplace_back();
      observations->features.descriptors.back().fill(static_cast<std::uint8_t>(random_.bits()));
      if (stereo_) observations->u_right.push_back(90);
    }
    NewKeyframe made;
    made.observations = observations;
    made.cam_from_world = Rigid3d({1, 0, 0, 0}, {-0.1 * count_++, 0, 0});
    made.landmarks.resize(keypoints);
    return made;
  }

  // A keyframe whose first keypoints see these landmarks.
  KeyframeId add(const std::vector<LandmarkId>& seen, KeyframeId reference = KeyframeId(0)) {
    NewKeyframe made = frame(std::max<std::size_t>(10, seen.size()));
    std::copy(seen.begin(), seen.end(), made.landmarks.begin());
    made.reference = reference;
    return map.add_keyframe(made);
  }

  const MapSnapshot& view() const { return map.view(); }
  bool consistent() const { return map.check_consistency() == std::vector<std::string>{}; }

  Map map;

 private:
  bool stereo_;
  Random random_{1};
  int count_ = 0;
};

// A stereo origin with `points` landmarks, the keypoint's number being the landmark's id.
TinyMap map_with_origin(std::uint32_t points) {
  TinyMap tiny(true);
  NewKeyframe made = tiny.frame(points);
  for (std::uint32_t i = 0; i < points; ++i) made.new_points.push_back({i, {0.1 * i, 0, 3}});
  tiny.map.add_keyframe(made);
  return tiny;
}

std::vector<LandmarkId> ids(std::uint32_t first, std::uint32_t last) {
  std::vector<LandmarkId> result;
  for (std::uint32_t i = first; i < last; ++i) result.emplace_back(i);
  return result;
}

TEST_CASE("The first keyframe is the origin and its stereo points are born") {
  TinyMap tiny = map_with_origin(5);
  CHECK(tiny.view().origin() == KeyframeId(0));
  CHECK(tiny.view().at(KeyframeId(0)).keep);
  CHECK(tiny.view().landmark_count() == 5);
  const Landmark& landmark = tiny.view().at(LandmarkId(3));
  CHECK(landmark.observations == std::vector<Observation>{{KeyframeId(0), 3}});
  CHECK(landmark.reference == KeyframeId(0));
  CHECK(landmark.object_scale == Approx(2. / 450 * landmark.point_in_world.norm()));
  CHECK(landmark.mean_direction.isApprox(landmark.point_in_world.normalized()));
  CHECK(tiny.consistent());
}

TEST_CASE("Features of no use are dropped, and all that names the others follows") {
  TinyMap tiny = map_with_origin(6);
  NewKeyframe made = tiny.frame(10);
  for (const std::uint32_t i : {1, 4, 5, 9}) made.landmarks[i] = LandmarkId(i % 6);
  auto observations_then = std::make_shared<FrameObservations>(*made.observations);
  for (const std::uint32_t i : {0, 1, 2, 3, 6, 8}) observations_then->u_right[i] = kNoRightMatch;
  made.observations = observations_then;  // without landmark 0, 2, 3, 6, 7, 8; of these 7 is stereo
  made.odometry = std::make_shared<const Odometry>(
      Odometry{KeyframeId(0), {{}, Vector6d::Constant(1e-4).asDiagonal()}, {0, 4, 8, 9}});
  const KeyframeId id = tiny.map.add_keyframe(made);
  const auto before = tiny.map.snapshot();
  CHECK(tiny.map.drop_features(id) == std::vector<std::uint32_t>{1, 4, 5, 7, 9});
  CHECK(tiny.consistent());
  const Keyframe& keyframe = tiny.view().at(id);
  CHECK(keyframe.landmarks == std::vector<LandmarkId>{LandmarkId(1), LandmarkId(4), LandmarkId(5),
                                                      LandmarkId(), LandmarkId(3)});
  CHECK(keyframe.observations->u_right.size() == 5);
  CHECK(keyframe.observations->dropped == 5);
  CHECK(keyframe.observations->features.descriptors[4] ==
        made.observations->features.descriptors[9]);
  CHECK(keyframe.odometry->keypoints == std::vector<std::uint32_t>{1, 4});
  CHECK(keyframe.odometry->followed() == 4);
  CHECK(tiny.view().at(LandmarkId(3)).observations.back() == Observation{id, 4});
  CHECK(tiny.view().at(LandmarkId(3)).descriptor == before->at(LandmarkId(3)).descriptor);
  CHECK(before->at(id).observations == made.observations);  // others look at what they had
  CHECK(before->at(LandmarkId(3)).observations.back() == Observation{id, 9});
  const auto observations = keyframe.observations;
  CHECK(tiny.map.drop_features(id) == std::vector<std::uint32_t>{0, 1, 2, 3, 4});
  CHECK(tiny.view().at(id).observations == observations);
  CHECK(tiny.map.drop_features(KeyframeId(7)).empty());

  MapEdit stale;  // by the indices of before
  stale.erased_observations = {{LandmarkId(4), {id, 4}}, {LandmarkId(3), {id, 2}}};
  tiny.map.apply(stale);
  CHECK_FALSE(tiny.view().at(id).landmarks[1].valid());
  CHECK(tiny.view().at(id).landmarks[4] == LandmarkId(3));  // was never at a lower index
  CHECK(tiny.consistent());
  stale.erased_observations = {{LandmarkId(4), {id, 10}}};
  CHECK_THROWS_AS(tiny.map.apply(stale), std::logic_error);
}

TEST_CASE("A keyframe is found by its frame until it is erased") {
  TinyMap tiny(true);
  CHECK(tiny.view().newest_frame_index(CameraId(0)) == -1);
  std::vector<KeyframeId> added;
  for (const int frame : {0, 4, 9}) {
    NewKeyframe made = tiny.frame(3);
    auto observations = std::make_shared<FrameObservations>(*made.observations);
    observations->frame_index = frame;
    made.observations = observations;
    added.push_back(tiny.map.add_keyframe(made));
  }
  const CameraId camera = tiny.view().at(added[0]).observations->camera;
  CHECK(tiny.view().newest_frame_index(camera) == 9);
  const CameraId other = tiny.map.add_camera(synthetic_fisheye_camera());
  CHECK(tiny.view().newest_frame_index(other) == -1);
  REQUIRE(tiny.view().find_frame(camera, 4) != nullptr);
  CHECK(tiny.view().find_frame(camera, 4)->id == added[1]);
  CHECK(tiny.view().find_frame(camera, 5) == nullptr);
  CHECK(tiny.view().find_frame(CameraId(7), 4) == nullptr);
  MapEdit edit;
  edit.erased_keyframes = {added[2]};
  tiny.map.apply(edit);
  CHECK(tiny.view().find_frame(camera, 9) == nullptr);
  CHECK(tiny.view().newest_frame_index(CameraId(0)) == 9);
}

TEST_CASE("A mono keypoint alone gives no landmark") {
  TinyMap tiny(false);
  NewKeyframe made = tiny.frame(3);
  made.new_points.push_back({1, {0, 0, 2}});
  const KeyframeId a = tiny.map.add_keyframe(made);
  CHECK(tiny.view().landmark_count() == 0);
  const KeyframeId b = tiny.add({});
  MapEdit edit;
  edit.new_landmarks.push_back({{0, 0, 2}, {{b, 2}, {a, 1}}});
  tiny.map.apply(edit);
  REQUIRE(tiny.view().landmark_count() == 1);
  const LandmarkId id = tiny.view().landmark_ids().front();
  CHECK(tiny.view().at(id).reference == a);
  CHECK(tiny.consistent());

  MapEdit erase;
  erase.erased_observations.push_back({id, {b, 2}});
  tiny.map.apply(erase);
  CHECK(tiny.view().landmark_count() == 0);
  CHECK(tiny.consistent());
}

TEST_CASE("Covisibility counts shared landmarks and chooses the parent") {
  TinyMap tiny = map_with_origin(20);
  const KeyframeId origin(0);
  const KeyframeId a = tiny.add(ids(0, 6));
  const KeyframeId b = tiny.add(ids(2, 6));
  CHECK(tiny.view().at(origin).covisible == std::vector<Covisible>{{a, 6}, {b, 4}});
  CHECK(tiny.view().at(b).covisible == std::vector<Covisible>{{origin, 4}, {a, 4}});
  CHECK(tiny.view().covisible(origin, 5, 10) == std::vector<Covisible>{{a, 6}});
  CHECK(tiny.view().covisible(origin, 1, 1) == std::vector<Covisible>{{a, 6}});
  CHECK(tiny.view().covisible(b, 1, 9) == std::vector<Covisible>{{origin, 4}, {a, 4}});
  CHECK(tiny.view().at(b).parent == origin);

  const KeyframeId alone = tiny.add({}, b);
  CHECK(tiny.view().at(alone).parent == b);
  CHECK(tiny.view().at(b).children == std::vector<KeyframeId>{alone});
  CHECK(tiny.consistent());
}

TEST_CASE("What is gone or taken is skipped") {
  TinyMap tiny = map_with_origin(6);
  const KeyframeId a = tiny.add(ids(0, 2));
  MapEdit edit;
  edit.merged.push_back({LandmarkId(99), LandmarkId(0)});
  edit.merged.push_back({LandmarkId(0), LandmarkId(99)});
  edit.merged.push_back({LandmarkId(0), LandmarkId(0)});
  edit.new_observations.push_back({LandmarkId(99), {a, 5}});             // no such landmark
  edit.new_observations.push_back({LandmarkId(3), {KeyframeId(9), 5}});  // no such keyframe
  edit.new_observations.push_back({LandmarkId(3), {a, 0}});              // keypoint taken
  edit.new_observations.push_back({LandmarkId(0), {a, 5}});              // seen by keypoint 0
  edit.new_landmarks.push_back({{0, 0, 1}, {{a, 0}, {KeyframeId(9), 1}}});
  edit.erased_observations.push_back({LandmarkId(1), {a, 0}});  // keypoint 0 sees landmark 0
  edit.erased_observations.push_back({LandmarkId(), {a, 7}});   // keypoint 7 sees nothing
  edit.erased_landmarks.push_back(LandmarkId(99));
  edit.erased_keyframes = {KeyframeId(9), KeyframeId(0)};  // unknown; the origin
  edit.counted = {{LandmarkId(99), 1, 1}};
  tiny.map.apply(edit);
  CHECK(tiny.view().landmark_ids() == ids(0, 6));
  CHECK(tiny.view().keyframe_count() == 2);
  CHECK(tiny.view().at(LandmarkId(0)).observations.size() == 2);
  CHECK(tiny.view().at(LandmarkId(1)).observations.size() == 2);
  CHECK(tiny.view().at(LandmarkId(3)).observations.size() == 1);
  CHECK(tiny.consistent());

  const KeyframeId b = tiny.add({LandmarkId(99), LandmarkId(2), LandmarkId(2)});
  CHECK(tiny.view().at(LandmarkId(2)).observations.back() == Observation{b, 1});
  CHECK_FALSE(tiny.view().at(b).landmarks[0].valid());
  CHECK_FALSE(tiny.view().at(b).landmarks[2].valid());
  CHECK(tiny.consistent());
}

TEST_CASE("What can never have been right is refused and changes nothing") {
  TinyMap tiny = map_with_origin(3);
  const KeyframeId origin(0);
  MapEdit edit;
  edit.erased_landmarks.push_back(LandmarkId(0));
  edit.new_observations.push_back({LandmarkId(0), {origin, 999}});
  CHECK_THROWS_AS(tiny.map.apply(edit), std::logic_error);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(tiny.map.move({}, {{LandmarkId(0), {0, nan, 1}}}), std::logic_error);
  CHECK_THROWS_AS(tiny.map.move({{origin, Rigid3d({1, 0, 0, 0}, {nan, 0, 0})}}, {}),
                  std::logic_error);
  NewKeyframe other_kind = tiny.frame(4);
  auto observations = std::make_shared<FrameObservations>(*other_kind.observations);
  observations->features.kind = DescriptorKind::kRootSiftOpenCv;
  other_kind.observations = observations;
  CHECK_THROWS_AS(tiny.map.add_keyframe(other_kind), std::logic_error);
  CHECK(tiny.view().landmark_ids() == ids(0, 3));
  CHECK(tiny.view().keyframe_count() == 1);
  CHECK(tiny.consistent());
}

TEST_CASE("Merging moves observations except where both are seen") {
  TinyMap tiny = map_with_origin(6);
  const KeyframeId origin(0);
  const KeyframeId a = tiny.add({LandmarkId(0)});
  NewKeyframe made = tiny.frame(4);
  made.landmarks[0] = LandmarkId(1);
  made.new_points.push_back({2, {0, 0, 3}});
  const KeyframeId b = tiny.map.add_keyframe(made);
  const LandmarkId born = tiny.view().at(b).landmarks[2];
  MapEdit edit;
  edit.merged = {{LandmarkId(0), born}, {LandmarkId(0), LandmarkId(1)}};
  tiny.map.apply(edit);
  CHECK(tiny.view().find(born) == nullptr);
  CHECK(tiny.view().find(LandmarkId(1)) == nullptr);
  CHECK(tiny.view().at(LandmarkId(0)).observations ==
        std::vector<Observation>{{origin, 0}, {a, 0}, {b, 2}});
  CHECK_FALSE(tiny.view().at(b).landmarks[0].valid());
  CHECK_FALSE(tiny.view().at(origin).landmarks[1].valid());
  CHECK(tiny.view().at(LandmarkId(0)).found == 3);
  CHECK(tiny.view().at(b).covisible == std::vector<Covisible>{{origin, 1}, {a, 1}});
  CHECK(tiny.consistent());
}

TEST_CASE("An erased keyframe leaves its children to the tree and its pose to its frames") {
  TinyMap tiny = map_with_origin(30);
  const KeyframeId origin(0);
  const KeyframeId a = tiny.add(ids(0, 10));
  const KeyframeId b = tiny.add({}, a);
  const KeyframeId c = tiny.add({}, a);
  MapEdit share;  // b and c see some of what the origin sees, but c shares most with b
  for (std::uint32_t i = 0; i < 3; ++i) share.new_observations.push_back({LandmarkId(i), {b, i}});
  share.new_observations.push_back({LandmarkId(0), {c, 0}});
  share.new_landmarks.push_back({{0, 0, 4}, {{b, 8}, {c, 8}}});
  tiny.map.apply(share);
  REQUIRE(tiny.view().at(a).children == std::vector<KeyframeId>{b, c});

  const Rigid3d a_before = tiny.view().at(a).cam_from_world;
  const LandmarkId first(0);
  MapEdit erase;
  erase.erased_keyframes = {a};
  tiny.map.apply(erase);
  CHECK(tiny.consistent());
  CHECK(tiny.view().find(a) == nullptr);
  CHECK(tiny.view().at(b).parent == origin);
  CHECK(tiny.view().at(c).parent == b);
  CHECK(tiny.view().at(first).observations ==
        std::vector<Observation>{{origin, 0}, {b, 0}, {c, 0}});
  CHECK(tiny.view().cam_from_world(a).params.isApprox(a_before.params));

  // The erased keyframe's place follows its parent, and through a second tombstone too.
  const Rigid3d shift({1, 0, 0, 0}, {0, 0, 5});
  tiny.map.move({{origin, tiny.view().at(origin).cam_from_world * shift}}, {});
  CHECK(tiny.view().cam_from_world(a).params.isApprox((a_before * shift).params));
  const KeyframeId d = tiny.add({}, a);
  CHECK(tiny.view().at(d).parent == origin);
  CHECK(tiny.consistent());
}

TEST_CASE("A chain of erased keyframes still leads to a pose") {
  TinyMap tiny = map_with_origin(3);
  const KeyframeId a = tiny.add({});
  const KeyframeId b = tiny.add({}, a);
  const KeyframeId c = tiny.add({}, b);
  const Rigid3d before = tiny.view().at(c).cam_from_world;
  for (const KeyframeId id : {c, b, a}) {
    MapEdit erase;
    erase.erased_keyframes = {id};
    tiny.map.apply(erase);
  }
  CHECK(tiny.view().keyframe_count() == 1);
  CHECK(tiny.view().cam_from_world(c).params.isApprox(before.params));
  CHECK(tiny.consistent());
}

TEST_CASE("A keyframe that is marked to be kept is not erased") {
  TinyMap tiny = map_with_origin(3);
  const KeyframeId a = tiny.add(ids(0, 2));
  tiny.map.set_keep(a);
  MapEdit erase;
  erase.erased_keyframes = {a};
  tiny.map.apply(erase);
  CHECK(tiny.view().find(a) != nullptr);
}

TEST_CASE("The reference moves on when its observation goes") {
  TinyMap tiny = map_with_origin(3);
  const KeyframeId a = tiny.add(ids(0, 1));
  MapEdit edit;
  edit.erased_observations.push_back({LandmarkId(0), {KeyframeId(0), 0}});
  edit.counted = {{LandmarkId(0), 1, 0}, {LandmarkId(1), 1, 1}};
  tiny.map.apply(edit);
  CHECK(tiny.view().at(LandmarkId(0)).reference == a);
  CHECK(tiny.view().at(LandmarkId(0)).visible == 2);
  CHECK(tiny.view().at(LandmarkId(0)).found == 1);
  CHECK(tiny.view().at(LandmarkId(1)).found == 2);
  CHECK(tiny.consistent());
}

TEST_CASE("The descriptor is the one with the least median distance") {
  TinyMap tiny(true);
  const std::vector<std::uint8_t> values{10, 90, 14, 200, 12};
  LandmarkId id;
  for (std::size_t i = 0; i < values.size(); ++i) {
    NewKeyframe made = tiny.frame(1);
    auto observations = std::make_shared<FrameObservations>(*made.observations);
    observations->features.descriptors[0].fill(values[i]);
    made.observations = observations;
    made.landmarks[0] = id;
    if (i == 0) made.new_points.push_back({0, {0, 0, 2}});
    const KeyframeId keyframe = tiny.map.add_keyframe(made);
    id = tiny.view().at(keyframe).landmarks[0];
  }
  CHECK(tiny.view().at(id).descriptor[0] == 12);
}

TEST_CASE("Moving poses and points renews directions and scales") {
  TinyMap tiny = map_with_origin(2);
  tiny.map.move({}, {{LandmarkId(0), {0, 6, 0}}, {LandmarkId(77), {1, 1, 1}}});
  CHECK(tiny.view().at(LandmarkId(0)).mean_direction.isApprox(Eigen::Vector3d::UnitY()));
  CHECK(tiny.view().at(LandmarkId(0)).object_scale == Approx(2. / 450 * 6));
  tiny.map.move({{KeyframeId(0), Rigid3d({1, 0, 0, 0}, {0, -2, 0})}}, {});
  CHECK(tiny.view().at(LandmarkId(0)).object_scale == Approx(2. / 450 * 4));
  Calibrated<RectifiedStereo> longer = synthetic_stereo_camera(0.1);
  longer.params[0] = longer.params[1] = 900;
  tiny.map.set_camera(CameraId(0), longer);
  CHECK(tiny.view().at(LandmarkId(0)).object_scale == Approx(2. / 900 * 4));
  CHECK(tiny.consistent());
}

TEST_CASE("A snapshot does not change when the map does") {
  TinyMap tiny = map_with_origin(8);
  const KeyframeId a = tiny.add(ids(0, 4));
  const auto snapshot = tiny.map.snapshot();
  const Landmark before = snapshot->at(LandmarkId(0));
  MapEdit edit;
  edit.erased_keyframes = {a};
  edit.erased_landmarks = ids(4, 8);
  tiny.map.apply(edit);
  tiny.map.move({}, {{LandmarkId(0), {9, 9, 9}}});
  tiny.add(ids(0, 2));

  CHECK(snapshot->landmark_count() == 8);
  CHECK(snapshot->keyframe_ids() == std::vector<KeyframeId>{KeyframeId(0), a});
  CHECK(snapshot->at(LandmarkId(0)).point_in_world == before.point_in_world);
  CHECK(snapshot->at(LandmarkId(0)).observations == before.observations);
  CHECK(snapshot->at(a).landmarks[3] == LandmarkId(3));
  CHECK(snapshot->at(KeyframeId(0)).covisible == std::vector<Covisible>{{a, 4}});
  CHECK(tiny.view().landmark_count() == 4);
  CHECK(tiny.consistent());
}

TEST_CASE("Keyframes from an id on are those that are left of them") {
  TinyMap tiny = map_with_origin(8);
  const auto from = [&](std::uint32_t first) {
    return tiny.view().keyframe_ids_from(KeyframeId(first));
  };
  const KeyframeId a = tiny.add(ids(0, 4)), b = tiny.add(ids(0, 4)), c = tiny.add(ids(0, 4));
  CHECK(from(0) == tiny.view().keyframe_ids());
  CHECK(from(b.value) == std::vector<KeyframeId>{b, c});
  CHECK(tiny.view().next_keyframe_id() == KeyframeId(c.value + 1));
  MapEdit edit;
  edit.erased_keyframes = {b, c};
  tiny.map.apply(edit);
  CHECK(from(a.value) == std::vector<KeyframeId>{a});
  CHECK(from(b.value).empty());
  CHECK(tiny.view().next_keyframe_id() == KeyframeId(c.value + 1));
  CHECK(from(c.value + 1).empty());
}

TEST_CASE("A map filled from a scene is consistent") {
  SyntheticSceneOptions options;
  options.fisheye = true;
  options.outlier_rate = 0.05;
  const SyntheticScene scene = make_synthetic_scene(options);
  const FilledMap filled = fill_map(scene, {});
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
  CHECK(filled.keyframes.size() == 40);
  CHECK(filled.map.view().landmark_count() > 1500);
  // The object size is the same through both cameras, so that scales can be predicted.
  const MapSnapshot& view = filled.map.view();
  for (const KeyframeId id : filled.keyframes) {
    const Keyframe& keyframe = view.at(id);
    const double focal = focal_length(view.camera(keyframe));
    for (std::size_t k = 0; k < keyframe.landmarks.size(); ++k) {
      if (!keyframe.landmarks[k].valid()) continue;
      const Landmark& landmark = view.at(keyframe.landmarks[k]);
      const double distance = (keyframe.cam_from_world * landmark.point_in_world).norm();
      const double predicted = focal * landmark.object_scale / distance;
      const double scale = keyframe.observations->features.keypoints[k].scale;
      if (std::abs(predicted / scale - 1) > 1e-4) FAIL("scale " << scale << ", not " << predicted);
    }
  }
}

}  // namespace
}  // namespace hybrid_slam
