#include "apps/io/report.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

TEST_CASE("stage times: percentiles by nearest rank, stages in order") {
  StageTimes times;
  times.add("tracking", 7);
  StageTimes sift;
  for (int i = 200; i >= 1; --i) sift.add("sift", i);
  times.merge(sift);
  const nlohmann::ordered_json json = to_json(times);
  CHECK(json.begin().key() == "tracking");
  CHECK(json["tracking"]["p99"] == 7.0);
  CHECK(json["sift"]["count"] == 200);
  CHECK(json["sift"]["mean"] == 100.5);
  CHECK(json["sift"]["p50"] == 100.0);
  CHECK(json["sift"]["p95"] == 190.0);
  CHECK(json["sift"]["p99"] == 198.0);
  CHECK(json["sift"]["max"] == 200.0);
}

TEST_CASE("of very many durations an even sample is kept, in order") {
  Durations all;
  Durations second_half;
  constexpr int kMany = 100'000;
  for (int i = 0; i < kMany; ++i) (i < kMany / 2 ? all : second_half).add(i);
  all.merge(second_half);
  CHECK(all.count() == kMany);
  CHECK(all.mean() == Approx((kMany - 1) / 2.0));
  CHECK(all.max() == kMany - 1);
  CHECK(all.kept().size() <= Durations::kMostKept);
  CHECK(all.kept().size() > Durations::kMostKept / 4);
  CHECK(std::is_sorted(all.kept().begin(), all.kept().end()));
  CHECK(percentile(all.kept(), 50) == Approx(kMany / 2.0).epsilon(0.001));
  CHECK(percentile(all.kept(), 99) == Approx(0.99 * kMany).epsilon(0.001));
}

TEST_CASE("a stage clock adds one duration per lap") {
  StageTimes times;
  StageClock clock(times);
  clock.lap("a");
  clock.lap("b");
  REQUIRE(times.stages().size() == 2);
  REQUIRE(times.stages()[0].second.count() == 1);
  CHECK(times.stages()[0].second.kept()[0] >= 0);
}

TEST_CASE("errors as JSON carry their units") {
  AbsoluteError absolute;
  absolute.position.rmse = 0.5;
  absolute.estimated_length = 9;
  CHECK(to_json(absolute)["length_ratio"].is_null());
  absolute.true_length = 10;
  CHECK(to_json(absolute)["length_ratio"] == 0.9);
  CHECK(to_json(absolute)["position_m"]["rmse"] == 0.5);
  RelativeError relative;
  relative.rotation.max = M_PI;
  CHECK(to_json(relative)["rotation_deg"]["max"].get<double>() == Approx(180));
}

TEST_CASE("JSON files hold valid JSON, whatever bytes a name had") {
  const TempFolder folder;
  write_json(folder.path() / "a.json", {{"name", "caf\xe9"}, {"value", 0.1}});
  const auto json = nlohmann::json::parse(read_text(folder.path() / "a.json"));
  CHECK(json["value"] == 0.1);
}

}  // namespace
}  // namespace hybrid_slam
