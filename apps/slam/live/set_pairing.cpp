#include "apps/slam/live/set_pairing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "cameras/files/input_error.h"
#include "frontend/input/median.h"

namespace hybrid_slam {
namespace {

constexpr double kMillisecond = 1e6;               // [ns]
constexpr std::int64_t kFisheyeMost = 10'000'000;  // [ns]; more moves the wrist visibly

// Those of `stamps` that another camera could have answered: from half a period before its first
// one to half a period after its last one.
Stamps within_reach(const Stamps& stamps, const Stamps& other, double period) {
  const auto reach = static_cast<std::int64_t>(period / 2);
  Stamps result;
  for (const std::int64_t stamp : stamps) {
    if (stamp >= other.front() - reach && stamp <= other.back() + reach) result.push_back(stamp);
  }
  return result;
}

// What nine of ten do not exceed.
double nine_of_ten(std::vector<double> values) {
  const std::size_t place = (9 * values.size() + 9) / 10 - 1;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(place);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

SetPairing::SetPairing(const PairingOptions& options) : options_(options) {
  at(LiveCamera::kLeft).used = true;
  at(LiveCamera::kRight).used = options.right;
  at(LiveCamera::kFisheye).used = options.fisheye;
}

void SetPairing::leave_out(LiveCamera camera) {
  at(camera).waiting.pop_front();
  ++of(alone_, camera);
}

void SetPairing::add(LiveCamera camera, StampedImage image) {
  Camera& its = at(camera);
  its.stamps.push_back(image.stamp);
  if (its.stamps.size() > options_.most_waiting) its.stamps.pop_front();
  const bool by_arrival = options_.stamps == StampKind::kArrival;
  if (by_arrival && ++its.unchecked >= options_.most_waiting) its.checked = false;
  if (by_arrival && !started_ && (options_.right || options_.fisheye)) return;
  its.waiting.push_back(std::move(image));
  if (its.waiting.size() > options_.most_waiting) leave_out(camera);
}

void SetPairing::set_away(LiveCamera camera, bool away) { at(camera).away = away; }

void SetPairing::restart(LiveCamera camera) {
  for (const LiveCamera other : kAllLiveCameras) {
    if (camera != LiveCamera::kLeft && other != camera) continue;  // all are compared with the left
    at(other).checked = false;
    at(other).told = false;
    at(other).stamps.clear();
  }
}

// Whether images can be brought together. What changed meanwhile is settled anew where it can be.
bool SetPairing::settle() {
  bool all = true;
  for (const LiveCamera camera : {LiveCamera::kRight, LiveCamera::kFisheye}) {
    Camera& its = at(camera);
    if (!its.used || its.checked) continue;
    if (settle(camera)) continue;
    const bool needed = camera == LiveCamera::kRight || (!started_ && !its.away);
    if (!its.match && needed) all = false;
  }
  started_ = started_ || all;
  return all;
}

bool SetPairing::settle(LiveCamera camera) {
  Camera& its = at(camera);
  const auto& left_stamps = at(LiveCamera::kLeft).stamps;
  Stamps left(left_stamps.begin(), left_stamps.end());
  Stamps other(its.stamps.begin(), its.stamps.end());
  if (left.empty() || other.empty()) return false;
  if (options_.stamps == StampKind::kArrival) {
    const double period = std::min(usual_period(left), usual_period(other));
    const Stamps answered = within_reach(left, other, period);
    other = within_reach(other, left, period);
    left = answered;
  }
  if (left.empty() || other.empty() || !is_enough(left, other)) return false;
  its.match.reset();
  its.match = match_of(camera, left, other);
  its.checked = true;
  its.told = true;
  its.unchecked = 0;
  return true;
}

bool SetPairing::is_enough(const Stamps& left, const Stamps& other) const {
  if (closed_ || (left.size() >= wanted_ && other.size() >= wanted_)) return true;
  if (options_.stamps == StampKind::kArrival) return false;
  const std::vector<double> differences = nearest_differences(left, other);
  return std::count_if(differences.begin(), differences.end(),
                       [](double d) { return std::abs(d) <= kSynchronous; }) >= 2;
}

StampMatch SetPairing::match_of(LiveCamera camera, const Stamps& left, const Stamps& other) {
  if (options_.stamps == StampKind::kArrival) return match_arrivals(camera, left, other);
  StampMatch match = match_stamps(left, other, options_.tolerance);
  if (camera == LiveCamera::kFisheye) match = {0, kFisheyeMost, match.least};
  if (match.offset != 0) {
    notes_.push_back(fmt::format(
        "{}'s times are {:.3g} ms later than left's throughout; that offset is taken out",
        to_string(camera), static_cast<double>(match.offset) / kMillisecond));
  }
  if (match.offset != 0 || std::abs(match.least) <= static_cast<double>(match.most)) return match;
  throw InputError(fmt::format(
      "left and {} have no times in common: the least difference is {:.3g} ms, the tolerance "
      "{:.3g} ms (--pair-tolerance)",
      to_string(camera), match.least / kMillisecond,
      static_cast<double>(match.most) / kMillisecond));
}

// The images of the slower camera each have one of the faster one's nearby.
StampMatch SetPairing::match_arrivals(LiveCamera camera, const Stamps& left, const Stamps& other) {
  const double left_period = usual_period(left), other_period = usual_period(other);
  const double period = std::min(left_period, other_period);
  std::vector<double> differences;
  if (left_period >= other_period) {
    differences = nearest_differences(left, other);
  } else {
    differences = nearest_differences(other, left);
    for (double& difference : differences) difference = -difference;
  }
  const double offset = median(differences);
  for (double& difference : differences) difference = std::abs(difference - offset);
  const double spread = nine_of_ten(differences);
  const auto most = static_cast<std::int64_t>(period / 2);
  if (spread < period / 4 && std::abs(offset) + spread < period / 2) {
    if (at(camera).told) return {static_cast<std::int64_t>(offset), most, 0};
    notes_.push_back(fmt::format("{}'s images come {:.1f} ms after left's, give or take {:.1f} ms",
                                 to_string(camera), offset / kMillisecond, spread / kMillisecond));
    return {static_cast<std::int64_t>(offset), most, 0};
  }
  throw InputError(fmt::format(
      "which images of left and {} belong together is unclear: they come {:.1f} ms apart, give or "
      "take {:.1f} ms, with an image every {:.1f} and {:.1f} ms; cameras that are triggered "
      "together and sent as one stream, side by side, are clear (--split)",
      to_string(camera), offset / kMillisecond, spread / kMillisecond, left_period / kMillisecond,
      other_period / kMillisecond));
}

// As pair_stamps().
void SetPairing::pair() {
  Camera& left = at(LiveCamera::kLeft);
  Camera& right = at(LiveCamera::kRight);
  if (!right.used) {
    for (StampedImage& image : left.waiting) pairs_.push_back({std::move(image), {}, {}});
    left.waiting.clear();
    return;
  }
  while (!left.waiting.empty() && !right.waiting.empty()) {
    const std::int64_t difference =
        right.match->difference(left.waiting.front().stamp, right.waiting.front().stamp);
    if (std::abs(difference) > right.match->most) {
      leave_out(difference > 0 ? LiveCamera::kLeft : LiveCamera::kRight);
      continue;
    }
    pairs_.push_back(
        {std::move(left.waiting.front()), std::move(right.waiting.front()), std::nullopt});
    left.waiting.pop_front();
    right.waiting.pop_front();
  }
  if (right.away && right.waiting.empty()) {
    while (!left.waiting.empty()) leave_out(LiveCamera::kLeft);
  }
  if (left.away && left.waiting.empty()) {
    while (!right.waiting.empty()) leave_out(LiveCamera::kRight);
  }
}

// Whether the set need not wait for its fisheye image any more. One that is not there when the next
// pair is will not come.
bool SetPairing::add_fisheye(ImageSet& set) {
  Camera& fisheye = at(LiveCamera::kFisheye);
  if (!fisheye.used || !fisheye.match) return true;
  while (!fisheye.waiting.empty()) {
    const std::int64_t difference =
        fisheye.match->difference(set.left.stamp, fisheye.waiting.front().stamp);
    if (difference > fisheye.match->most) return true;
    if (difference >= -fisheye.match->most) {
      set.fisheye = std::move(fisheye.waiting.front());
      fisheye.waiting.pop_front();
      return true;
    }
    leave_out(LiveCamera::kFisheye);
  }
  return fisheye.away || closed_ || pairs_.size() > 1;
}

// Arrivals that are unclear at first may have been jolted: more of them are looked at together.
bool SetPairing::settle_patiently() {
  try {
    return settle();
  } catch (const InputError&) {
    const bool more = options_.stamps == StampKind::kArrival && !started_ && !closed_;
    if (!more || 2 * wanted_ > options_.most_waiting) throw;
    wanted_ *= 2;
    return false;
  }
}

std::optional<ImageSet> SetPairing::take() {
  if (!settle_patiently()) return std::nullopt;
  pair();
  if (pairs_.empty() || !add_fisheye(pairs_.front())) return std::nullopt;
  ImageSet set = std::move(pairs_.front());
  pairs_.pop_front();
  return set;
}

std::vector<std::string> SetPairing::notes() { return std::exchange(notes_, {}); }

}  // namespace hybrid_slam
