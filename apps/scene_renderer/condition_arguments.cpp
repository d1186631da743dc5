#include "apps/scene_renderer/condition_arguments.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

namespace hybrid_slam {
namespace {

constexpr double kLongestSpell = 1e5;  // [s]

// A whole text as a number, which is finite.
std::optional<double> number_in(const std::string& text) {
  double value = 0;
  const char* const end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, value);
  if (read.ec != std::errc() || read.ptr != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

// "START:LENGTH" [s].
Spell spell_in(const std::string& option, const std::string& text) {
  const std::size_t colon = text.find(':');
  const auto start = number_in(text.substr(0, colon));
  const auto length = colon == std::string::npos ? std::nullopt : number_in(text.substr(colon + 1));
  if (!start || !length || *start < 0 || *length <= 0 || *start + *length > kLongestSpell) {
    throw CLI::ValidationError(option + ": \"" + text +
                               "\" is no START:LENGTH in seconds like 8:3");
  }
  return {*start, *length};
}

std::vector<Spell> spells_in(const std::string& option, const std::vector<std::string>& texts) {
  std::vector<Spell> spells;
  for (const std::string& text : texts) spells.push_back(spell_in(option, text));
  return spells;
}

// "NAME=VALUE".
void read_error(const std::string& text, Miscalibration& errors) {
  const std::size_t sign = text.find('=');
  const std::string name = text.substr(0, sign);
  for (const auto& known : miscalibration_numbers()) {
    if (name != known.name) continue;
    const auto value = sign == std::string::npos ? std::nullopt : number_in(text.substr(sign + 1));
    if (!value || *value < known.lowest || *value > known.highest) break;
    errors.*known.value = *value;
    return;
  }
  throw CLI::ValidationError("--miscalibrate: \"" + text +
                             "\" is none of pitch=, yaw=, roll= (-2 to 2), focal=, distortion= "
                             "(-5 to 5), flat-port= (0 to 100)");
}

}  // namespace

struct ConditionArguments::Given {
  std::vector<std::optional<double>> numbers;  // as condition_numbers()
  std::optional<Ground> ground;
  std::vector<std::string> lamps_off, silt, miscalibrate;  // as written
  Conditions read;                                         // those, once checked
};

ConditionArguments::ConditionArguments(CLI::App& app) : given_(std::make_unique<Given>()) {
  constexpr const char* kGroup = "Hard conditions";
  const auto numbers = condition_numbers();
  given_->numbers.resize(numbers.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    app.add_option(std::string("--") + numbers[i].name, given_->numbers[i], numbers[i].text)
        ->option_text(numbers[i].unit)
        ->group(kGroup);
  }
  app.add_option("--ground", given_->ground, "rocks (default) or sand: ripples, hardly any texture")
      ->transform(CLI::CheckedTransformer(grounds()).description(""))
      ->option_text("NAME")
      ->group(kGroup);
  const auto add_list = [&](const char* name, std::vector<std::string>& texts, const char* form,
                            const char* text) {
    app.add_option(name, texts, text)->delimiter(',')->option_text(form)->group(kGroup);
  };
  add_list("--lamps-off", given_->lamps_off, "START:LENGTH,...",
           "times in which no lamp is on [s]; no daylight reaches the ground then or else");
  add_list("--silt", given_->silt, "START:LENGTH,...", "times with silt before all cameras [s]");
  add_list("--miscalibrate", given_->miscalibrate, "NAME=VALUE,...",
           "the stereo cameras are not as the calibration says: pitch, yaw, roll of the right one "
           "[deg], focal [%], distortion [% at the corner], flat-port [mm from the lens]");
}

ConditionArguments::~ConditionArguments() = default;

void ConditionArguments::check() {
  const auto numbers = condition_numbers();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto& value = given_->numbers[i];
    if (value && !(*value >= numbers[i].lowest && *value <= numbers[i].highest)) {  // not NaN
      throw CLI::ValidationError(fmt::format("--{}: is not between {} and {} {}", numbers[i].name,
                                             numbers[i].lowest, numbers[i].highest,
                                             numbers[i].unit));
    }
  }
  given_->read.lamps_off = spells_in("--lamps-off", given_->lamps_off);
  given_->read.silt = spells_in("--silt", given_->silt);
  for (const std::string& text : given_->miscalibrate) {
    read_error(text, given_->read.miscalibration);
  }
}

void ConditionArguments::apply(Conditions& conditions) const {
  const auto numbers = condition_numbers();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (given_->numbers[i]) conditions.*numbers[i].value = *given_->numbers[i];
  }
  if (given_->ground) conditions.ground = *given_->ground;
  if (!given_->lamps_off.empty()) conditions.lamps_off = given_->read.lamps_off;
  if (!given_->silt.empty()) conditions.silt = given_->read.silt;
  if (!given_->miscalibrate.empty()) conditions.miscalibration = given_->read.miscalibration;
}

}  // namespace hybrid_slam
