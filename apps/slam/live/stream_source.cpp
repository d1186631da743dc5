#include "apps/slam/live/stream_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "cameras/files/input_error.h"

namespace hybrid_slam {
namespace {

using namespace std::chrono_literals;

bool are_files(const std::vector<StreamSpec>& specs) {
  return std::all_of(specs.begin(), specs.end(), [](const StreamSpec& spec) { return spec.ends; });
}

bool has(const std::vector<StreamSpec>& specs, LiveCamera camera) {
  return std::any_of(specs.begin(), specs.end(),
                     [&](const StreamSpec& spec) { return spec.camera == camera; });
}

PairingOptions pairing_of(const std::vector<StreamSpec>& specs, const StreamOptions& options) {
  PairingOptions pairing;
  pairing.stamps = are_files(specs) ? StampKind::kSensor : StampKind::kArrival;
  pairing.right = has(specs, LiveCamera::kRight);
  pairing.fisheye = has(specs, LiveCamera::kFisheye);
  pairing.tolerance = options.tolerance;
  return pairing;
}

double seconds(StreamClock::Clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

StreamSource::StreamSource(std::vector<StreamSpec> specs, const StreamOptions& options)
    : options_(options),
      keeps_all_(are_files(specs) && !options.realtime),
      pairing_(pairing_of(specs, options)),
      inbox_(std::make_shared<StreamInbox>(!keeps_all_)) {
  grab_.by_position = are_files(specs);
  grab_.paced = !keeps_all_;
  for (StreamSpec& spec : specs) {
    State& state = of(states_, spec.camera);
    state.used = true;
    state.name = spec.name;
    state.ends = spec.ends;
    grabbers_.push_back(std::make_unique<Grabber>(std::move(spec), inbox_, grab_));
  }
}

StreamSource::~StreamSource() { inbox_->close(); }

std::optional<ImageSet> StreamSource::next(const std::stop_token& stop) {
  constexpr auto kLook = 200ms;
  while (!stop.stop_requested()) {
    if (auto set = take()) return set;
    if (over_) return std::nullopt;
    auto event = inbox_->next(stop, Clock::now() + kLook, held());
    if (event) handle(std::move(*event));
    look_for_silence();
  }
  inbox_->close();
  return std::nullopt;
}

// Before the first set, what is unclear ends the run; later it has to become clear again.
std::optional<ImageSet> StreamSource::take() {
  const bool settled = pairing_.settled();
  std::optional<ImageSet> set;
  try {
    set = pairing_.take();
  } catch (const InputError& error) {
    if (!settled) throw;
    tell(error.what());
    pairing_.restart(LiveCamera::kLeft);
  }
  for (const std::string& note : pairing_.notes()) tell(note);
  if (set && options_.split) split(*set);
  return set;
}

// Videos wait in their threads while enough of their images are here.
PerCamera<bool> StreamSource::held() const {
  PerCamera<bool> held{};
  for (const LiveCamera camera : kAllLiveCameras) {
    of(held, camera) = keeps_all_ && pairing_.waiting(camera) >= 2 * SetPairing::kSettling;
  }
  return held;
}

void StreamSource::handle(StreamEvent event) {
  State& state = of(states_, event.camera);
  switch (event.kind) {
    case StreamEvent::Kind::kImage:
      add(event.camera, std::move(event.image));
      return;
    case StreamEvent::Kind::kOpened:
      state.anew = state.delivered;
      return;
    case StreamEvent::Kind::kLost:
      state.why = event.text;
      if (state.delivered) lose(event.camera, event.text);
      return;
    case StreamEvent::Kind::kEnded:
      if (!state.delivered) throw InputError(state.name + ": holds no images that can be read");
      state.ended = true;
      pairing_.set_away(event.camera, true);
      over_ = std::all_of(states_.begin(), states_.end(),
                          [](const State& its) { return its.ended || !its.ends; });
      if (over_) pairing_.close();
      return;
    case StreamEvent::Kind::kFailed:
      throw InputError(event.text);
  }
}

void StreamSource::add(LiveCamera camera, StampedImage image) {
  State& state = of(states_, camera);
  const auto now = Clock::now();
  if (state.lost) {
    tell(fmt::format("{}: the {} camera is back after {:.1f} s", state.name, to_string(camera),
                     seconds(now - state.last)));
    pairing_.set_away(camera, false);
  }
  if (state.lost || state.anew) pairing_.restart(camera);
  if (state.delivered && !state.lost) {
    const double step = seconds(now - state.last);
    state.period = state.period > 0 ? 0.9 * state.period + 0.1 * step : step;
  }
  state.lost = state.anew = false;
  state.delivered = true;
  state.last = now;
  ++of(counts_.images, camera);
  pairing_.add(camera, std::move(image));
}

void StreamSource::lose(LiveCamera camera, const std::string& why) {
  State& state = of(states_, camera);
  if (state.lost) return;
  state.lost = true;
  ++of(counts_.lost, camera);
  pairing_.set_away(camera, true);
  tell(fmt::format("{}; the {} camera is lost, and taken up again when it is back", why,
                   to_string(camera)));
}

void StreamSource::look_for_silence() {
  constexpr double kLeast = 2;    // [s]
  constexpr double kPeriods = 5;  // without an image
  const auto now = Clock::now();
  for (const LiveCamera camera : kAllLiveCameras) {
    const State& state = of(states_, camera);
    if (!state.used) continue;
    if (!state.delivered && seconds(now - grab_.clock.start) > options_.timeout) {
      throw InputError(
          fmt::format("{}: the {} camera delivers nothing: no image in {:g} s{}; "
                      "--timeout waits longer",
                      state.name, to_string(camera), options_.timeout,
                      state.why.empty() ? "" : " (" + state.why + ")"));
    }
    const double silence = seconds(now - state.last);
    if (!state.delivered || state.ends || inbox_->waiting(camera) > 0) continue;
    if (silence < std::max(kLeast, kPeriods * state.period)) continue;
    lose(camera, fmt::format("{}: no image for {:.1f} s", state.name, silence));
  }
}

void StreamSource::split(ImageSet& set) const {
  const GrayImage both = std::move(set.left.image);
  const int width = both.width / 2;
  if (both.width % 2 != 0) {
    set.error = fmt::format("{}: images of {}x{} are no two of equal width side by side",
                            of(states_, LiveCamera::kLeft).name, both.width, both.height);
    return;
  }
  set.left.image = {width, both.height, {}};
  set.right = {set.left.stamp, {width, both.height, {}}, {}};
  for (int y = 0; y < both.height; ++y) {
    const std::uint8_t* const row = both.row(y);
    auto& left = set.left.image.pixels;
    auto& right = set.right.image.pixels;
    left.insert(left.end(), row, row + width);
    right.insert(right.end(), row + width, row + both.width);
  }
}

LiveCounts StreamSource::counts() const {
  LiveCounts counts = counts_;
  counts.alone = pairing_.alone();
  counts.dropped = inbox_->dropped();
  counts.held_up = inbox_->held_up();
  return counts;
}

}  // namespace hybrid_slam
