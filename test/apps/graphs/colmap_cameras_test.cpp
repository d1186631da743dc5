#include "apps/io/graphs/colmap_cameras.h"

#include <sstream>

#include <catch2/catch.hpp>

#include "apps/io/graphs/colmap.h"
#include "apps/io/graphs/graph_errors.h"
#include "apps/io/graphs/model_reprojection.h"
#include "backend/problem/solve_graph.h"
#include "cameras/field_of_view.h"
#include "cameras/radial_fisheye.h"
#include "cameras/rational.h"
#include "cameras/thin_prism_fisheye.h"
#include "factors/manifolds.h"
#include "test/apps/graphs/graph_checks.h"
#include "test/support/factor_check.h"
#include "test/support/random.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

// A camera of each model that becomes a block, as the file has it.
struct FileCamera {
  const char* model;
  std::vector<double> params;
};

const std::vector<FileCamera> kCameras{
    {"OPENCV", {500, 510, 320.5, 240.5, -0.1, 0.02, 0.001, -0.002}},
    {"FULL_OPENCV", {500, 510, 320.5, 240.5, -0.1, 0.02, 0.001, -0.002, 0.01, 0.02, -0.01, 0.003}},
    {"FOV", {500, 510, 320.5, 240.5, 0.9}},
    {"SIMPLE_RADIAL_FISHEYE", {400, 320.5, 240.5, -0.02}},
    {"RADIAL_FISHEYE", {400, 320.5, 240.5, -0.02, 0.003}},
    {"THIN_PRISM_FISHEYE",
     {400, 402, 320.5, 240.5, -0.02, 0.003, 0.001, -0.002, 0.0004, 0, 0.001, -0.0005}}};

// The pixel by our models, written down here once more; the corner of the image is the origin.
Eigen::Vector2d pixel_of(const FileCamera& camera, const Eigen::Vector3d& point) {
  std::vector<double> p = camera.params;
  const std::string model = camera.model;
  Eigen::Vector2d pixel;
  bool ok = false;
  if (model == "SIMPLE_RADIAL_FISHEYE" || model == "RADIAL_FISHEYE") {
    p.resize(5);
    ok = RadialFisheye::project(p.data(), point.data(), pixel.data());
  } else if (model == "FOV") {
    ok = FieldOfView::project(p.data(), point.data(), pixel.data());
  } else {
    p.resize(12);
    ok = model == "THIN_PRISM_FISHEYE"
             ? ThinPrismFisheye::project(p.data(), point.data(), pixel.data())
             : Rational::project(p.data(), point.data(), pixel.data());
  }
  REQUIRE(ok);
  return pixel;
}

// Two images per camera, around 40 points; poses and points in the files are off by `error`.
void write_model(const fs::path& folder, double error) {
  Random random(3);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 40; ++i) {
    points.emplace_back(random.uniform(-1.5, 1.5), random.uniform(-1, 1), random.uniform(4, 6));
  }
  std::ostringstream cameras, images, tracks;
  cameras.precision(17);
  images.precision(17);
  tracks.precision(17);
  std::vector<std::string> seen_by(points.size());
  for (std::size_t c = 0; c < kCameras.size(); ++c) {
    cameras << c + 1 << ' ' << kCameras[c].model << " 640 480";
    for (const double value : kCameras[c].params) cameras << ' ' << value;
    cameras << '\n';
    for (int k = 0; k < 2; ++k) {
      const std::size_t id = 2 * c + static_cast<std::size_t>(k) + 1;
      Rigid3d pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.1 * (k + 1), Eigen::Vector3d::UnitY())),
                   Eigen::Vector3d(0.3 * k, 0.1 * static_cast<double>(c), 0.2 * k));
      std::ostringstream line;
      line.precision(17);
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Eigen::Vector2d pixel = pixel_of(kCameras[c], pose * points[i]);
        line << pixel.x() << ' ' << pixel.y() << ' ' << i + 1 << ' ';
        seen_by[i] += ' ' + std::to_string(id) + ' ' + std::to_string(i);
      }
      if (id > 1) pose.translation() += error * random.vector(3, 1);
      const auto q = pose.rotation();
      const auto t = pose.translation();
      images << id << ' ' << q.w() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << ' ' << t.x()
             << ' ' << t.y() << ' ' << t.z() << ' ' << c + 1 << " i.png\n"
             << line.str() << '\n';
    }
  }
  cameras << "99 RAD_TAN_THIN_PRISM_FISHEYE 640 480 400 400 320 240 1 2 3 4 5 6 7 8 9 10 11 12\n";
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p = points[i] + error * random.vector(3, 1);
    tracks << i + 1 << ' ' << p.x() << ' ' << p.y() << ' ' << p.z() << " 1 2 3 0.5" << seen_by[i]
           << '\n';
  }
  write_text(folder / "cameras.txt", cameras.str());
  write_text(folder / "images.txt", images.str());
  write_text(folder / "points3D.txt", tracks.str());
}

}  // namespace

TEMPLATE_TEST_CASE("Reprojections of any model: Jacobians", "", Rational, FieldOfView,
                   RadialFisheye, ThinPrismFisheye) {
  using M = TestType;
  Random random(5);
  const PoseManifold manifold;
  for (int i = 0; i < 20; ++i) {
    Eigen::VectorXd params = 0.01 * random.vector(M::kParamCount, 1);
    params.head<4>() << 500, 510, 320, 240;
    if (M::kParamCount == 5) params[4] = std::is_same_v<M, FieldOfView> ? 0.9 : 0.01;
    if (std::is_same_v<M, RadialFisheye>) params.head<4>() << 500, 320, 240, -0.02;
    const Rigid3d cam_from_world = random.rigid(0.5, 0.5);
    const Eigen::Vector3d point =
        inverse(cam_from_world) *
        Eigen::Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(2, 5));
    const ModelReprojection<M> factor({300, 200});
    const std::vector<FactorBlock> blocks = {
        {cam_from_world.params, &manifold}, {point, nullptr}, {params, nullptr}};
    CHECK(factor_mismatch(factor, blocks) < 1e-7);
  }
}

// Camera.img_from_cam of pycolmap 4.2.1, of (0.7, -0.4, 2) and (-0.9, 0.8, 1.5).
TEST_CASE("COLMAP: pixels of every model are COLMAP's") {
  const double pixels[][4] = {
      {492.271171875, 140.37010625, 35.657037037037014, 498.50199012345684},
      {491.7636619445718, 140.66591203802096, 37.537146500777794, 496.7973575429985},
      {499.637782249979, 136.08826406001222, 46.58932038541036, 488.8456828505613},
      {453.18899159275145, 164.67771908985634, 120.1227324653639, 418.6131266974543},
      {453.197599082961, 164.67280052402225, 119.99571822073472, 418.7260282482358},
      {452.91133168404224, 164.4538476199824, 119.21422496226407, 420.2437609780655}};
  for (std::size_t i = 0; i < kCameras.size(); ++i) {
    CAPTURE(kCameras[i].model);
    const auto& [u, v, u2, v2] = pixels[i];
    CHECK((pixel_of(kCameras[i], {0.7, -0.4, 2}) - Eigen::Vector2d(u, v)).norm() < 1e-9);
    CHECK((pixel_of(kCameras[i], {-0.9, 0.8, 1.5}) - Eigen::Vector2d(u2, v2)).norm() < 1e-9);
  }
}

TEST_CASE("COLMAP: cameras of every model are read, optimised and written") {
  const TempFolder folder;
  write_model(folder.path() / "exact", 0);
  const GraphFile exact = read_graph(folder.path() / "exact");
  REQUIRE(exact.graph.factors.size() == 12 * 40);
  CHECK(exact.graph.blocks.size() == kCameras.size());
  CHECK(exact.graph.validate() == "");
  CHECK(cost(exact.graph) < 1e-15);

  write_model(folder.path() / "input", 0.02);
  const GraphFile file = read_graph(folder.path() / "input");
  FactorGraph solved = file.graph;
  ProblemOptions options;
  options.rounds.assign(1, {50, Loss::kNone, 1e-14});
  const GraphSummary summary = solve_graph(solved, options);
  CHECK(summary.initial_cost > 100);
  CHECK(summary.final_cost < 1e-8);
  for (const auto& [name, error] : reprojection_errors(solved)) {
    CAPTURE(name);
    CHECK(error.observations >= 80);
    CHECK(error.rmse < 1e-4);
  }
  CHECK(reprojection_errors(solved).size() == 4);
  for (const GraphWriter& writer : file.writers) {
    const fs::path written = writer.write(solved, folder.path());
    const GraphFile again = read_graph(written);
    CHECK(std::abs(cost(again.graph) - summary.final_cost) < 1e-12);
    fs::remove_all(written);
  }
  const ColmapModel model = read_colmap_text(file.writers[0].write(solved, folder.path()));
  REQUIRE(model.cameras.size() == kCameras.size() + 1);
  CHECK(model.cameras[0].params[2] == 320.5);  // principal points stay
  CHECK(model.cameras[0].params[0] != 500);
  CHECK(model.cameras.back().params[15] == 12);
  CHECK(model.points[0].error < 1e-4);
}

TEST_CASE("COLMAP: a camera that cannot be read is refused where an image uses it") {
  const TempFolder folder;
  write_model(folder.path(), 0);
  std::string images = read_text(folder.path() / "images.txt");
  const std::size_t at = images.find(" 6 i.png");
  REQUIRE(at != std::string::npos);
  write_text(folder.path() / "images.txt", images.replace(at, 8, " 99 i.png"));
  CHECK(refusal(folder.path())
            .find("cameras.txt:7: camera model RAD_TAN_THIN_PRISM_FISHEYE is not "
                  "supported where an image uses it") != std::string::npos);
}

}  // namespace hybrid_slam
