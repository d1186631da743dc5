#include "apps/scene_renderer/scene_json.h"

#include <cmath>
#include <stdexcept>

namespace hybrid_slam {

using Json = nlohmann::ordered_json;

namespace {

constexpr double kBlindBelow = 0.15;       // CommonView::visible, GroundView::visible
constexpr double kTurnedAwayBelow = 0.15;  // CommonView::in_view

template <typename Name>
std::string name_of(const std::map<std::string, Name>& names, Name value) {
  for (const auto& [name, named] : names) {
    if (named == value) return name;
  }
  throw std::logic_error("an option without a name");
}

double rounded(double value) { return std::round(1000 * value) / 1000; }

template <typename Whole>
void add_numbers(const Whole& whole, std::span<const NamedNumber<Whole>> numbers, Json& json) {
  for (const auto& number : numbers) {
    if (whole.*number.value != 0) json[number.key] = whole.*number.value;
  }
}

Json spells_json(const std::vector<Spell>& spells) {
  Json json = Json::array();
  for (const Spell& spell : spells) json.push_back(Json::array({spell.start, spell.length}));
  return json;
}

// What is not as in a plain sequence.
Json conditions_json(const Conditions& conditions) {
  Json json = Json::object();
  add_numbers(conditions, condition_numbers(), json);
  if (conditions.ground != Ground::kRocks) json["ground"] = name_of(grounds(), conditions.ground);
  if (!conditions.lamps_off.empty()) {
    json["lamps_off_start_and_length_s"] = spells_json(conditions.lamps_off);
  }
  if (!conditions.silt.empty()) json["silt_start_and_length_s"] = spells_json(conditions.silt);
  if (conditions.miscalibration != Miscalibration{}) {
    Json errors = Json::object();
    add_numbers(conditions.miscalibration, miscalibration_numbers(), errors);
    json["miscalibration"] = errors;
  }
  return json;
}

// What became of each frame, and what the left camera sees in it.
void add_left(const SceneSequence& sequence, Json& json) {
  const Conditions& conditions = sequence.options().conditions;
  Json blind = Json::array(), visible = Json::array(), arm = Json::array(), blur = Json::array(),
       factor = Json::array(), doubled = Json::array(), dropped = Json::array();
  int expected = 0;
  for (int i = 0; i < static_cast<int>(sequence.fates().size()); ++i) {
    const FrameFate& fate = sequence.fates()[static_cast<std::size_t>(i)];
    for (; expected < fate.moment; ++expected) dropped.push_back(expected);
    ++expected;
    if (fate.picture != fate.moment) doubled.push_back(i);
    const GroundView view = sequence.ground_view(i);
    if (view.visible < kBlindBelow) blind.push_back(i);
    visible.push_back(rounded(view.visible));
    arm.push_back(rounded(view.arm));
    blur.push_back(rounded(view.blur));
    factor.push_back(exposure_factor(conditions, fate.picture / sequence.options().rate,
                                     visit_seed(sequence.options())));
  }
  for (; expected < sequence.options().frames; ++expected) dropped.push_back(expected);
  if (conditions.dropped > 0) {
    json["images"] = sequence.fates().size();
    json["dropped_moments"] = dropped;
  }
  if (conditions.doubled > 0) json["doubled_frames"] = doubled;
  Json left{{"blind_frames", blind}, {"visible", visible}};
  if (conditions.arm > 0) left["arm_share"] = arm;
  if (conditions.exposure_time > 0) left["blur_px"] = blur;
  json["left"] = left;
  json["exposure_factor"] = factor;
}

Json camera_json(const Lens& lens) {
  const auto& nominal = std::get<Calibrated<Pinhole>>(lens.calibrated());
  const auto& [fx, fy, cx, cy] = nominal.params;
  return Json{{"width", nominal.width},
              {"height", nominal.height},
              {"fx", lens.true_focal()},
              {"fy", lens.true_focal() * fy / fx},
              {"cx", cx},
              {"cy", cy},
              {"radial_k1", lens.k1()}};
}

}  // namespace

Json scene_json(const SceneSequence& sequence) {
  const SceneOptions& options = sequence.options();
  Json json{{"kind", name_of(scene_kinds(), options.kind)},
            {"preset", name_of(difficulties(), options.difficulty)},
            {"seed", options.seed},
            {"frames", options.frames},
            {"rate_hz", options.rate}};
  if (options.visit > 0) json["visit"] = options.visit;
  if (options.kind == SceneKind::kSurvey) json["width_m"] = 2 * survey_radius(options);
  if (const Json hardship = conditions_json(options.conditions); !hardship.empty()) {
    json["conditions"] = hardship;
    add_left(sequence, json);
  }
  if (options.kind != SceneKind::kHybrid) return json;
  Json blind = Json::array(), away = Json::array(), in_view = Json::array(),
       visible = Json::array();
  for (int i = 0; i < static_cast<int>(sequence.motion().size()); ++i) {
    const CommonView view = sequence.common_view(i);
    if (view.in_view < kTurnedAwayBelow) {
      away.push_back(i);
    } else if (view.visible < kBlindBelow) {
      blind.push_back(i);
    }
    in_view.push_back(rounded(view.in_view));
    visible.push_back(rounded(view.visible));
  }
  json["fisheye"] = Json{{"blind_frames", blind},
                         {"turned_away_frames", away},
                         {"common_view", in_view},
                         {"common_view_visible", visible}};
  return json;
}

Json true_cameras_json(const SceneSequence& sequence) {
  const Miscalibration& errors = sequence.options().conditions.miscalibration;
  const Eigen::Matrix3d turn = right_turn(errors).toRotationMatrix();
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) {
    rows.push_back(Json::array({turn(row, 0), turn(row, 1), turn(row, 2)}));
  }
  Json json{{"left", camera_json(sequence.stereo_lens())},
            {"right", camera_json(sequence.stereo_lens())},
            {"left_from_right_rotation", rows},
            {"left_from_right_translation_m",
             Json::array({sequence.cameras().stereo.params[4], 0.0, 0.0})}};
  if (sequence.stereo_lens().has_port()) {
    json["flat_port"] = Json{{"distance_m", errors.flat_port / 1000},
                             {"water_index", kWaterIndex},
                             {"calibrated_at_m", kPortCalibratedAt}};
  }
  return json;
}

}  // namespace hybrid_slam
