// Runs that are watched, as browsers and their users see them.
#include <catch2/catch.hpp>

#include <algorithm>
#include <csignal>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>

#include "test/apps/program_run.h"
#include "test/apps/rendered_survey.h"
#include "test/apps/view/http_client.h"
#include "test/support/child_process.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::json;
using namespace std::chrono_literals;
namespace fs = std::filesystem;

// Rows of a csv file by their columns' names.
std::vector<std::map<std::string, std::string>> csv_rows(const fs::path& path) {
  std::istringstream lines(read_text(path));
  const auto fields = [](const std::string& line) {
    std::vector<std::string> parts;
    std::istringstream rest(line + ",");
    for (std::string part; std::getline(rest, part, ',');) parts.push_back(part);
    return parts;
  };
  std::string line;
  std::getline(lines, line);
  const auto names = fields(line);
  std::vector<std::map<std::string, std::string>> rows;
  while (std::getline(lines, line)) {
    const auto values = fields(line);
    rows.emplace_back();
    for (std::size_t i = 0; i < names.size(); ++i) rows.back()[names[i]] = values.at(i);
  }
  return rows;
}

std::vector<std::string> watched_arguments(const fs::path& data, int port,
                                           std::vector<std::string> more) {
  more.insert(more.begin(), {"--view", std::to_string(port)});
  return slam_arguments(data, more);
}

// Follows a run as soon as it can be followed.
std::unique_ptr<HttpClient> follow(int port, int receive_buffer = 0) {
  const auto end = std::chrono::steady_clock::now() + 60s;
  while (std::chrono::steady_clock::now() < end) {
    auto client = std::make_unique<HttpClient>(port, "127.0.0.1", receive_buffer);
    if (client->connected()) {
      client->get("/events");
      return client;
    }
  }
  FAIL("no server at port " << port);
  return nullptr;
}

// What a watcher was told of the frames: those of the state, and those that came one by one.
struct Told {
  std::size_t in_state = 0;
  std::vector<Json> frames;
  std::size_t pictures = 0;
  std::size_t maps = 0;
  std::vector<double> late;  // of the frames, from their result to here [s]
  std::string end;
};

double seconds_since_1970() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

Told all_events(HttpClient& client) {
  Told told;
  while (const auto event = client.event(60s)) {
    const double now = seconds_since_1970();
    const Json data = Json::parse(event->second);
    if (event->first == "frame") told.late.push_back(now - data["told"].get<double>());
    if (event->first == "state" && told.frames.empty()) told.in_state = data["frames"]["count"];
    if (event->first == "frame") told.frames.push_back(data);
    told.pictures += event->first == "picture" ? 1 : 0;
    told.maps += event->first == "map" || event->first == "state" ? 1 : 0;
    if (event->first == "end") told.end = data["text"];
  }
  return told;
}

void check_number(const Json& told, const std::string& written, double relative) {
  if (written.empty()) {
    CHECK(told.is_null());
    return;
  }
  CHECK(told.get<double>() == Approx(std::stod(written)).epsilon(relative).margin(1e-9));
}

void check_frame(const Json& told, std::map<std::string, std::string>& written) {
  INFO(written["camera"] << ' ' << written["time"]);
  CHECK(told["camera"] == (written["camera"] == "stereo" ? 0 : 1));
  check_number(told["time"], written["time"], 1e-12);
  for (const char* const name : {"state", "source", "prediction", "causes"}) {
    CHECK(told[name] == written[name]);
  }
  for (const char* const name : {"features", "stereo_matches", "inliers", "odometer_inliers",
                                 "component", "keyframes", "landmarks"}) {
    INFO(name);
    check_number(told[name], written[name], 0);
  }
  check_number(told["sigma_position"], written["sigma_position"], 1e-5);
  check_number(told["sigma_rotation_deg"], written["sigma_rotation_deg"], 1e-5);
  if (written["row_error_px"].empty()) {
    CHECK(told["row_error_px"].is_null());
  } else {
    CHECK(std::abs(told["row_error_px"].get<double>() - std::stod(written["row_error_px"])) < 1e-4);
  }
  const char* const axes[] = {"tx", "ty", "tz"};
  for (std::size_t k = 0; k < 3; ++k) {
    check_number(written["tx"].empty() ? told["position"] : told["position"][k], written[axes[k]],
                 1e-9);
  }
}

}  // namespace

TEST_CASE("who watches a run is told what frames.csv says", "[view]") {
  const TempFolder folder;
  write_uwslam_survey(folder.path() / "data", false);
  const int port = free_port();
  // Slow enough to be watched from the first frames on.
  ChildProcess run(HYBRID_SLAM,
                   watched_arguments("data", port, {"--mode", "realtime", "--rate", "1"}),
                   folder.path());
  REQUIRE(
      run.wait_for_error_text("watch it at http://127.0.0.1:" + std::to_string(port) + "/", 60s));
  HttpClient page(port);
  page.get("/");
  const auto [status, text] = page.answer();
  CHECK(status == 200);
  CHECK(text.find("connect-src 'self'") != std::string::npos);
  CHECK(text.find(R"("live":true)") != std::string::npos);
  const auto client = follow(port);
  const Told told = all_events(*client);
  const Outcome outcome = run.finish(60s);
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  auto rows = csv_rows(folder.path() / "out/frames.csv");
  CHECK(told.in_state + told.frames.size() == rows.size());
  REQUIRE(told.frames.size() >= 3);
  for (std::size_t i = 0; i < told.frames.size(); ++i) {
    check_frame(told.frames[i], rows.at(told.in_state + i));
  }
  CHECK(told.pictures >= 2);
  CHECK(told.maps >= 1);
  std::vector<double> late = told.late;
  std::nth_element(late.begin(), late.begin() + static_cast<std::ptrdiff_t>(late.size() / 2),
                   late.end());
  CHECK(late[late.size() / 2] < 0.3);
  CHECK(told.end == "results are in out");
}

TEST_CASE("ten watchers come and go and one stands still: the run is the same", "[view]") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data", 40);
  const int port = free_port();
  ChildProcess run(HYBRID_SLAM, watched_arguments("data", port, {"--out", "watched"}),
                   folder.path());
  const auto stalled = follow(port, 2048);  // reads nothing, ever
  for (int i = 0; i < 10; ++i) {
    HttpClient visitor(port);
    if (!visitor.connected()) break;  // it was faster than we
    visitor.get("/events");
    if (i % 2 == 0) visitor.event(1s);
  }
  const Outcome outcome = run.finish(120s);
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  CHECK(run_slam(folder.path(), "data", {"--out", "alone"}).code == 0);
  for (const char* const file : {"frames.csv", "stereo.tum", "map.hslam", "loops.csv"}) {
    INFO(file);
    CHECK(read_text(folder.path() / "watched" / file) == read_text(folder.path() / "alone" / file));
  }
}

TEST_CASE("a port that cannot be had is told before the run begins", "[view]") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  const int port = free_port();
  ChildProcess first(HYBRID_SLAM,
                     watched_arguments("data", port, {"--mode", "realtime", "--rate", "0.2"}),
                     folder.path());
  REQUIRE(first.wait_for_error_text("watch it at", 60s));
  const std::string text = std::to_string(port);
  check_refused(run_slam(folder.path(), "data", {"--view", text, "--out", "second"}), 2,
                "--view: port " + text + " is in use");
  CHECK_FALSE(fs::exists(folder.path() / "second"));

  HttpClient elsewhere(port, "127.0.0.2");  // this machine, by another address
  CHECK_FALSE(elsewhere.connected());
  const auto status = [port](const std::string& path, const std::string& host,
                             const std::string& method) {
    HttpClient client(port);
    client.get(path, host, method);
    return client.answer().first;
  };
  CHECK(status("/", "localhost:" + text, "GET") == 200);
  CHECK(status("/", "127.0.0.1", "GET") == 200);
  CHECK(status("/", "somebody.example", "GET") == 403);
  CHECK(status("/", "127.0.0.1.somebody.example", "GET") == 403);
  CHECK(status("/summary.json", "localhost", "GET") == 404);
  CHECK(status("/", "localhost", "DELETE") == 404);
  first.send(SIGINT);
  CHECK(first.finish(60s).code == 130);
}

TEST_CASE("what is no port or no address is refused in one line", "[view]") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data", 2);
  const auto refused = [&](const std::vector<std::string>& options, const std::string& reason) {
    check_refused(run_slam(folder.path(), "data", options), 2, reason);
  };
  refused({"--view", "70000"}, "\"70000\" is no port");
  refused({"--view", "here"}, "\"here\" is no port");
  refused({"--view-address", "127.0.0.1"}, "--view-address needs --view");
  refused({"--view", "0", "--view-address", "192.0.2.1"},
          "192.0.2.1 is no address of this machine");
  refused({"--view", "0", "--view-address", "not an address"}, "not an address");
}

TEST_CASE("map_tool makes reports of maps and plays a finished run", "[view]") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  REQUIRE(run_slam(folder.path(), "data", {"--report", "off"}).code == 0);
  const auto tool = [&](const std::vector<std::string>& arguments) {
    return run_program(MAP_TOOL, arguments, folder.path());
  };
  CHECK(tool({"report", "out/map.hslam"}).out == "report     out/map.html\n");
  CHECK(read_text(folder.path() / "out/map.html").find("map.hslam") != std::string::npos);
  CHECK(tool({"report", "out", "--out", "page.html"}).code == 0);
  CHECK(read_text(folder.path() / "page.html").find("connect-src") == std::string::npos);
  check_refused(tool({"report", "out/map.hslam", "--out", "out/map.hslam"}), 3, "is an input",
                "map_tool");
  check_refused(tool({"report", "data"}), 3, "no results of a run", "map_tool");
  check_refused(tool({"report", "a", "b", "--out", "c"}), 2, "--out is for one input", "map_tool");
  check_refused(tool({"view", "nothing"}), 3, "nothing: no folder of results", "map_tool");

  const int port = free_port();
  ChildProcess viewer(MAP_TOOL, {"view", "out", "--port", std::to_string(port)}, folder.path());
  const auto page = follow(port);  // which has no events
  CHECK(page->answer().first == 404);
  const auto get = [port](const std::string& path) {
    HttpClient client(port);
    client.get(path);
    return client.answer();
  };
  const auto [status, text] = get("/");
  CHECK(status == 200);
  CHECK(text.find(R"("served":true)") != std::string::npos);
  const auto [found, picture] = get("/picture?at=0:0.2");
  REQUIRE(found == 200);
  const Json json = Json::parse(picture);
  CHECK(json["width"] == 320);
  CHECK(json["time"] == Approx(0.2));
  CHECK(json["jpeg"].get<std::string>().starts_with("/9j/"));  // a JPEG file begins so
  CHECK(get("/picture?at=0:0.25").second == "null");           // between two frames
  CHECK(get("/picture?at=1:0.2").second == "null");            // there is no fisheye
  for (const char* const nothing : {"0:", "2:0.2", "0:nan", "0:0.2x", ""}) {
    INFO(nothing);
    CHECK(get(std::string("/picture?at=") + nothing).first == 404);
  }
  check_refused(tool({"view", "out", "--port", std::to_string(port)}), 2, "is in use", "map_tool");
  viewer.send(SIGINT);
  CHECK(viewer.finish(30s).code == 0);
}

}  // namespace hybrid_slam
