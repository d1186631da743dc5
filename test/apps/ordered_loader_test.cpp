#include "apps/pipeline/ordered_loader.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>

#include "cameras/input_error.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {
namespace {

// Frames without features. Some take longer than others; some cannot be read; one breaks.
class StubSource final : public FrameSource {
 public:
  std::size_t size() const override { return 40; }
  const Calibrated<RectifiedStereo>& camera() const override { return camera_; }
  std::unique_ptr<FrameLoader> make_loader() const override {
    class Loader final : public FrameLoader {
     public:
      explicit Loader(const StubSource& source) : source_(source) {}
      FrameSet load(std::size_t index, StageTimes& times) override {
        ++source_.begun;
        times.add("load", 1);
        std::this_thread::sleep_for(std::chrono::microseconds(index % 3 == 0 ? 2000 : 10));
        if (index == source_.broken) throw std::logic_error("broken");
        if (index % 10 == 7) throw InputError("unreadable " + std::to_string(index));
        return {make_frame(static_cast<std::int64_t>(index), 0, {}, 10, 10), {}, {}};
      }

     private:
      const StubSource& source_;
    };
    return std::make_unique<Loader>(*this);
  }

  mutable std::atomic<int> begun = 0;
  std::size_t broken = 1000;

 private:
  Calibrated<RectifiedStereo> camera_ = synthetic_stereo_camera(0.1);
};

OrderedLoader::NextIndex all_of(const StubSource& source) {
  return [next = std::size_t{0}, size = source.size()]() mutable {
    return next < size ? std::optional(next++) : std::nullopt;
  };
}

TEST_CASE("Frames come in order, however many threads load them", "[pipeline]") {
  for (const int threads : {1, 2, 5}) {
    const StubSource source;
    OrderedLoader loader(source, threads, all_of(source));
    for (std::size_t i = 0; i < source.size(); ++i) {
      const auto loaded = loader.next();
      REQUIRE(loaded);
      CHECK(loaded->index == i);
      CHECK(loaded->frames.has_value() == (i % 10 != 7));
      if (loaded->frames) {
        CHECK(loaded->frames->stereo.index == static_cast<std::int64_t>(i));
      } else {
        CHECK(loaded->error == "unreadable " + std::to_string(i));
      }
    }
    CHECK_FALSE(loader.next());
    loader.join();
    CHECK(loader.times().stages().front().second.size() == source.size());
  }
}

TEST_CASE("No more frames are begun than the window holds", "[pipeline]") {
  const StubSource source;
  OrderedLoader loader(source, 2, all_of(source));
  for (int taken = 1; taken <= 10; ++taken) {
    REQUIRE(loader.next());
    CHECK(source.begun <= taken + 3);  // threads + 1 beyond what was consumed
  }
}

TEST_CASE("A stopped loader delivers what was begun and ends", "[pipeline]") {
  const StubSource source;
  OrderedLoader loader(source, 3, all_of(source));
  REQUIRE(loader.next());
  loader.stop();
  std::size_t count = 1;
  while (const auto loaded = loader.next()) CHECK(loaded->index == count++);
  CHECK(count <= 5);
  loader.join();
}

TEST_CASE("What a loader throws beside InputError reaches the consumer", "[pipeline]") {
  StubSource source;
  source.broken = 12;
  OrderedLoader loader(source, 2, all_of(source));
  const auto consume = [&] {
    while (loader.next()) {
    }
  };
  CHECK_THROWS_AS(consume(), std::logic_error);
}

}  // namespace
}  // namespace hybrid_slam
