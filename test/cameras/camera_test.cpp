#include "cameras/camera.h"

#include <limits>

#include <catch2/catch.hpp>

#include "test/support/test_cameras.h"

namespace hybrid_slam {

TEST_CASE("Camera: each model behind the variant") {
  const Camera mono = TestCamera<Pinhole>::camera();
  const Camera stereo = TestCamera<RectifiedStereo>::camera();
  const Camera fisheye = TestCamera<KannalaBrandt>::camera();
  const Camera radial = TestCamera<Radial>::camera();
  const Camera bal = TestCamera<Bal>::camera();
  const Eigen::Vector3d point(0.3, -0.2, 2);
  const Eigen::Vector3d beside(3, 0.1, -0.2);

  CHECK(model_name(mono) == "pinhole");
  CHECK(model_name(stereo) == "rectified_stereo");
  CHECK(model_name(fisheye) == "kannala_brandt");
  CHECK(model_name(radial) == "radial");
  CHECK(model_name(bal) == "bal");
  CHECK(focal_length(mono) == Approx(869.8));
  CHECK(focal_length(stereo) == 868.4);
  CHECK(focal_length(fisheye) == Approx(302.55));
  CHECK(focal_length(radial) == 712.4);
  CHECK(focal_length(bal) == 712.4);
  CHECK(baseline(stereo) == 0.15);
  CHECK(baseline(mono) == 0);
  CHECK(image_width(fisheye) == 1024);
  CHECK(image_height(stereo) == 768);

  CHECK_FALSE(project(mono, beside).has_value());
  CHECK_FALSE(project(stereo, beside).has_value());
  CHECK_FALSE(project(radial, beside).has_value());
  CHECK(project(fisheye, beside).has_value());
  for (const Camera& camera : {mono, stereo, fisheye, radial}) {
    const auto pixel = project(camera, point);
    REQUIRE(pixel.has_value());
    CHECK(in_image(camera, *pixel));
    const auto bearing = unproject(camera, *pixel);
    REQUIRE(bearing.has_value());
    CHECK((*bearing - point.normalized()).norm() < 1e-12);
  }
}

TEST_CASE("Camera: a stereo measurement gives its point back") {
  const Camera stereo = TestCamera<RectifiedStereo>::camera();
  const Eigen::Vector3d point(0.3, -0.2, 2);
  const auto measurement = project_stereo(stereo, point);
  REQUIRE(measurement.has_value());
  CHECK((*measurement)[2] == Approx((*measurement)[0] - 868.4 * 0.15 / 2));
  const auto again = triangulate_stereo(stereo, *measurement);
  REQUIRE(again.has_value());
  CHECK((*again - point).norm() < 1e-12);

  Eigen::Vector3d at_infinity = *measurement;
  at_infinity[2] = at_infinity[0];
  CHECK_FALSE(triangulate_stereo(stereo, at_infinity).has_value());
  at_infinity[2] = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(triangulate_stereo(stereo, at_infinity).has_value());
  const Camera mono = TestCamera<Pinhole>::camera();
  CHECK_FALSE(project_stereo(mono, point).has_value());
  CHECK_FALSE(triangulate_stereo(mono, *measurement).has_value());
}

TEST_CASE("Camera: the image reaches half a pixel beyond the outer pixels' centres") {
  const Camera camera = TestCamera<Pinhole>::camera();
  CHECK(in_image(camera, {-0.5, 0}));
  CHECK(in_image(camera, {1023.49, 767.49}));
  CHECK_FALSE(in_image(camera, {-0.51, 0}));
  CHECK_FALSE(in_image(camera, {1023.5, 0}));
  CHECK_FALSE(in_image(camera, {0, 767.5}));
  CHECK_FALSE(in_image(camera, {std::numeric_limits<double>::quiet_NaN(), 0}));
}

}  // namespace hybrid_slam
