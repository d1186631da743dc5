#include <algorithm>
#include <vector>

#include <catch2/catch.hpp>

#include "apps/feature_eval/study/error_curve.h"
#include "apps/feature_eval/study/study.h"

namespace hybrid_slam {
namespace {

double area_of(const std::vector<std::pair<double, double>>& corners) {
  double area = 0;
  for (std::size_t i = 1; i < corners.size(); ++i) {
    area +=
        (corners[i].first - corners[i - 1].first) * (corners[i].second + corners[i - 1].second) / 2;
  }
  return area / 180;
}

TEST_CASE("the area under a curve of errors is what is computed by hand") {
  CHECK(area_under_curve(std::vector<double>{}) == 0);
  CHECK(area_under_curve(std::vector<double>{0}) == 1);
  CHECK(area_under_curve(std::vector<double>{180, 180}) == 0);
  CHECK(area_under_curve(std::vector<double>{90}) == Approx(0.5));
  // 0 up to 10 degrees, one half up to 40, all beyond: (30 / 2 + 140) / 180.
  CHECK(area_under_curve(std::vector<double>{40, 10}) == Approx(155.0 / 180));
  // A third from 0 on, two thirds from 60 on: (60 / 3 + 120 * 2 / 3) / 180; one never found.
  CHECK(area_under_curve(std::vector<double>{60, 180, 0}) == Approx(100.0 / 180));
}

TEST_CASE("the curve of errors goes up in steps and encloses that area") {
  const auto corners = error_curve(std::vector<double>{40, 10});
  const std::vector<std::pair<double, double>> expected{{0, 0},    {10, 0}, {10, 0.5},
                                                        {40, 0.5}, {40, 1}, {180, 1}};
  CHECK(corners == expected);
  for (const auto& errors : std::vector<std::vector<double>>{
           {}, {0}, {180}, {3, 3, 170}, {12.5, 80, 0.25, 180, 179.5}}) {
    CHECK(area_of(error_curve(errors)) == Approx(area_under_curve(errors)).margin(1e-12));
  }
}

TEST_CASE("a method's scores are means over its pairs and medians of its times") {
  MethodResult method;
  const auto add = [&](double rotation, double direction, int inliers) {
    PairResult pair;
    pair.motion[0] = {inliers, rotation, direction};
    pair.motion[1] = {2 * inliers, rotation / 2, direction / 2};
    method.pairs.push_back(pair);
  };
  add(9, 18, 30);
  add(27, 36, 60);
  add(180, 180, 0);
  method.image_times = {5, 1, 9};
  method.match_times = {2, 8, 3};
  const StudyScores plane = scores_of(method, StudyModel::kPlane);
  CHECK(plane.auc_rotation == Approx((0.95 + 0.85 + 0) / 3));
  CHECK(plane.auc_translation == Approx((0.9 + 0.8 + 0) / 3));
  CHECK(plane.mean_inliers == Approx(30));
  CHECK(plane.ms_per_image == 5);
  CHECK(plane.ms_per_match == 3);
  const StudyScores bearings = scores_of(method, StudyModel::kBearings);
  CHECK(bearings.auc_rotation == Approx((0.975 + 0.925 + 0.5) / 3));
  CHECK(bearings.mean_inliers == Approx(60));
}

}  // namespace
}  // namespace hybrid_slam
