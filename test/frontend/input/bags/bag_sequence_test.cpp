#include <cstdlib>
#include <fstream>
#include <iostream>

#include <catch2/catch.hpp>

#include "frontend/input/bags/bag_files.h"
#include "frontend/input/bags/bag_sequence.h"
#include "frontend/input/rectification.h"
#include "test/frontend/input/bags/bag_writer.h"
#include "test/frontend/input/dataset_writer.h"
#include "test/support/child_process.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 40, kHeight = 30, kFrames = 5;
constexpr double kFocal = 50.5, kCx = 19.25, kCy = 14.75, kBaseline = 0.125;
const std::vector<std::string> kTimes{"0.0", "0.1", "0.2000001", "0.35", "0.4"};

std::int64_t stamp_of(int frame) { return std::llround(std::stod(kTimes[frame]) * 1e9); }

CameraInfoMessage rectified_info(bool right) {
  CameraInfoMessage info;
  info.width = kWidth, info.height = kHeight;
  info.distortion_model = "plumb_bob";
  info.d.assign(5, 0.0);
  info.k = {kFocal, 0, kCx, 0, kFocal, kCy, 0, 0, 1};
  info.r = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.p = {kFocal, 0, kCx, right ? -kFocal * kBaseline : 0, 0, kFocal, kCy, 0, 0, 0, 1, 0};
  return info;
}

TestImage gray_image(std::int64_t stamp, int seed) {
  const cv::Mat picture = test_picture(kWidth, kHeight, seed);
  TestImage image{stamp, kWidth, kHeight, "mono8", false, kWidth, {}};
  image.data.assign(picture.begin<std::uint8_t>(), picture.end<std::uint8_t>());
  return image;
}

struct Recording {
  Wire wire;
  std::string image_type = "sensor_msgs/msg/Image", info_type = "sensor_msgs/msg/CameraInfo";
  std::string left = "/stereo/left/image_raw", right = "/stereo/right/image_raw";
};

std::string info_of(const std::string& topic) {
  return topic.substr(0, topic.rfind('/')) + "/camera_info";
}

std::vector<TestMessage> record(const Recording& r, int first = 0, int last = kFrames) {
  std::vector<TestMessage> messages;
  for (int frame = first; frame < last; ++frame) {
    const std::int64_t stamp = stamp_of(frame);
    for (const bool right : {true, false}) {
      const std::string& topic = right ? r.right : r.left;
      messages.push_back(
          {info_of(topic), r.info_type, camera_info_bytes(r.wire, stamp, rectified_info(right))});
      messages.push_back(
          {topic, r.image_type, image_bytes(r.wire, gray_image(stamp, 2 * frame + right))});
    }
  }
  return messages;
}

// The same as record(), in KITTI's layout.
void write_kitti(const fs::path& folder) {
  std::string times;
  for (int frame = 0; frame < kFrames; ++frame) {
    times += kTimes[frame] + "\n";
    const std::string name = "00000" + std::to_string(frame) + ".png";
    write_picture(folder / "image_0" / name, test_picture(kWidth, kHeight, 2 * frame));
    write_picture(folder / "image_1" / name, test_picture(kWidth, kHeight, 2 * frame + 1));
  }
  write_text(folder / "times.txt", times);
  write_text(folder / "calib.txt",
             "P0: 50.5 0 19.25 0 0 50.5 14.75 0 0 0 1 0\nP1: 50.5 0 19.25 -6.3125 0 50.5 14.75 0 0 "
             "0 1 0\n");
}

std::unique_ptr<ImageSequence> open_one(const fs::path& path, const BagOptions& bags = {},
                                        SequenceCameras cameras = SequenceCameras::kAuto) {
  CHECK(is_bag(path));
  return open_bags({path.string()}, cameras, bags, {});
}

std::string refusal(const fs::path& path, const BagOptions& bags = {},
                    SequenceCameras cameras = SequenceCameras::kAuto) {
  return complaint([&] { open_bags({path.string()}, cameras, bags, {}); });
}

void check_same(const ImageSequence& bag, const ImageSequence& folders) {
  REQUIRE(bag.size() == folders.size());
  CHECK(bag.info().times == folders.info().times);
  CHECK(bag.info().stereo == folders.info().stereo);
  for (std::size_t frame = 0; frame < bag.size(); ++frame) {
    const FrameImages a = bag.read(frame), b = folders.read(frame);
    CHECK(a.time == b.time);
    CHECK(a.left.pixels == b.left.pixels);
    CHECK(a.right.pixels == b.right.pixels);
  }
}

TEST_CASE("bags of every kind give the images, times and calibration of the same folders") {
  const TempFolder folder;
  write_kitti(folder.path() / "kitti");
  const auto folders = open_sequence((folder.path() / "kitti").string(), SequenceLayout::kAuto, "");
  const Recording ros1{
      {Serialization::kRos1, false}, "sensor_msgs/Image", "sensor_msgs/CameraInfo"};
  const Recording little, big{{Serialization::kCdr, true}};
  const fs::path path = folder.path() / "some.bag";
  for (const char* const compression : {"none", "bz2", "lz4"}) {
    write_ros1_bag(path, record(ros1), {compression, 3, true});
    check_same(*open_one(path), *folders);
  }
  for (const Recording& recording : {little, big}) {
    for (const char* const compression : {"none", "lz4", "zstd"}) {
      write_mcap(path, record(recording), {compression, 5, true});
      const auto sequence = open_one(path);
      check_same(*sequence, *folders);
      CHECK(sequence->info().warnings.empty());
      CHECK(sequence->info().layout == "bag");
      CHECK(sequence->info().name == "some");
    }
  }
  write_mcap(path, record(ros1), {"zstd", 5, true}, "ros1");
  check_same(*open_one(path), *folders);
  fs::remove(path);
  write_sqlite_bag(path, record(little));
  check_same(*open_one(path), *folders);
}

TEST_CASE("bags that follow one another are one sequence, as a list or as rosbag2's folder") {
  const TempFolder folder;
  write_kitti(folder.path() / "kitti");
  const auto folders = open_sequence((folder.path() / "kitti").string(), SequenceLayout::kAuto, "");
  const fs::path ros2 = folder.path() / "drive";
  fs::create_directories(ros2);
  write_mcap(ros2 / "drive_0.mcap", record({}, 0, 2), {"zstd", 3, true});
  write_mcap(ros2 / "drive_1.mcap", record({}, 2, kFrames), {"none", 0, true});
  check_same(*open_one(ros2), *folders);
  const std::string first = (ros2 / "drive_0.mcap").string(),
                    second = (ros2 / "drive_1.mcap").string();
  check_same(*open_bags({second, first}, SequenceCameras::kAuto, {}, {}), *folders);
  write_text(ros2 / "metadata.yaml",
             "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n"
             "    - drive/drive_0.mcap\n    - drive_1.mcap\n    - drive_2.mcap\n");
  const auto listed = open_one(ros2);
  check_same(*listed, *folders);
  REQUIRE(listed->info().warnings.size() == 1);
  CHECK(listed->info().warnings[0].ends_with(": lists drive_2.mcap, which is missing"));
  CHECK(listed->info().name == "drive");
  CHECK(!is_bag(folder.path() / "kitti"));
  CHECK(!is_bag(folder.path() / "nothing"));
}

TEST_CASE("topics are found by name, or given") {
  const TempFolder folder;
  const fs::path path = folder.path() / "some.mcap";
  Recording raw, other;
  other.left = "/cam0/image", other.right = "/cam1/image";
  std::vector<TestMessage> messages = record(raw);
  for (TestMessage& message : record(other)) messages.push_back(message);
  write_mcap(path, messages, {"none", 4, true});
  CHECK(open_one(path)->size() == kFrames);  // words before numbers
  BagOptions bags;
  bags.topics = {"cam0/image", "/cam1/image", ""};
  CHECK(open_one(path, bags)->size() == kFrames);
  bags.topics = {"/cam0/image", "", ""};
  CHECK(open_one(path, bags)->size() == kFrames);
  bags.topics = {"/cam7/image", "/cam1/image", ""};
  CHECK(refusal(path, bags) ==
        path.string() +
            ": no images on topic /cam7/image; there are /stereo/right/image_raw "
            "(sensor_msgs/Image, 5), /stereo/left/image_raw (sensor_msgs/Image, 5), /cam1/image "
            "(sensor_msgs/Image, 5), /cam0/image (sensor_msgs/Image, 5), "
            "/stereo/right/camera_info (sensor_msgs/CameraInfo, 5), /stereo/left/camera_info "
            "(sensor_msgs/CameraInfo, 5), /cam1/camera_info (sensor_msgs/CameraInfo, 5), "
            "/cam0/camera_info (sensor_msgs/CameraInfo, 5)");
  bags.topics = {"/cam0/image", "/cam0/image", ""};
  CHECK(refusal(path, bags).ends_with("cannot be both left and right"));
  Recording back = raw;
  back.left = "/back/left/image_raw", back.right = "/back/right/image_raw";
  for (TestMessage& message : record(back)) messages.push_back(message);
  write_mcap(path, messages, {"none", 4, true});
  CHECK(refusal(path).find("several pairs of topics could be meant: ") != std::string::npos);
  raw.right = "/stereo/starboard/image_raw";
  write_mcap(path, record(raw), {"none", 4, true});
  CHECK(refusal(path).find("no two image topics are named as a stereo pair") != std::string::npos);
}

TEST_CASE("compressed images are told by their content") {
  const TempFolder folder;
  write_kitti(folder.path() / "kitti");
  const auto folders = open_sequence((folder.path() / "kitti").string(), SequenceLayout::kAuto, "");
  Recording r;
  std::vector<TestMessage> messages;
  for (const TestMessage& message : record(r)) {
    if (message.type == r.info_type) messages.push_back(message);
  }
  for (int frame = 0; frame < kFrames; ++frame) {
    for (const bool right : {false, true}) {
      const std::string png = read_text(folder.path() / "kitti" / (right ? "image_1" : "image_0") /
                                        ("00000" + std::to_string(frame) + ".png"));
      messages.push_back(
          {(right ? r.right : r.left) + "/compressed", "sensor_msgs/msg/CompressedImage",
           compressed_image_bytes(r.wire, stamp_of(frame), {png.begin(), png.end()})});
    }
  }
  const fs::path path = folder.path() / "some.db3";
  write_sqlite_bag(path, messages);
  check_same(*open_one(path), *folders);
}

TEST_CASE("raw images are rectified by what CameraInfo says") {
  const TempFolder folder;
  const Eigen::Matrix3d left_turn =
      Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitX()).toRotationMatrix();
  const Eigen::Matrix3d right_turn =
      Eigen::AngleAxisd(-0.03, Eigen::Vector3d::UnitY()).toRotationMatrix();
  std::vector<TestMessage> messages;
  for (const TestMessage& message : record({})) {
    if (message.topic.find("camera_info") == std::string::npos) {
      messages.push_back(message);
      continue;
    }
    const bool right = message.topic.find("right") != std::string::npos;
    CameraInfoMessage info = rectified_info(right);
    info.d = {0.05, -0.01, 0.001, -0.002, 0};
    const Eigen::Matrix3d turn = right ? right_turn : left_turn;
    for (int i = 0; i < 9; ++i) info.r[static_cast<std::size_t>(i)] = turn(i / 3, i % 3);
    messages.push_back({message.topic, message.type, camera_info_bytes({}, 0, info)});
  }
  write_mcap(folder.path() / "raw.mcap", messages, {"none", 4, true});
  const auto sequence = open_one(folder.path() / "raw.mcap");
  // A point at p in the rectified frame is at left_turn^T p and right_turn^T (p - baseline).
  const RawCamera camera{kFocal, kFocal,           kCx, kCy, {0.05, -0.01, 0.001, -0.002, 0},
                         false,  {kWidth, kHeight}};
  const Rigid3d right_from_left(Eigen::Quaterniond(right_turn.transpose() * left_turn),
                                -(right_turn.transpose() * Eigen::Vector3d(kBaseline, 0, 0)));
  const StereoRectifier rectifier(camera, camera, right_from_left, "test");
  CHECK(sequence->info().stereo.params[0] == Approx(rectifier.focal_length()).epsilon(1e-9));
  CHECK(sequence->info().stereo.params[4] == Approx(kBaseline).epsilon(1e-9));
  FrameImages images = sequence->read(1);
  GrayImage left{kWidth, kHeight, gray_image(0, 2).data},
      right{kWidth, kHeight, gray_image(0, 3).data};
  rectifier.rectify_left(left);
  rectifier.rectify_right(right);
  CHECK(images.left.pixels == left.pixels);
  CHECK(images.right.pixels == right.pixels);
}

TEST_CASE("calibration files are taken instead of CameraInfo") {
  const TempFolder folder;
  const fs::path path = folder.path() / "some.mcap";
  std::vector<TestMessage> messages;
  for (const TestMessage& message : record({})) {
    if (message.topic.find("camera_info") == std::string::npos) messages.push_back(message);
  }
  write_mcap(path, messages, {"none", 4, true});
  const auto ros = [](const char* p3) {
    return std::string(
               "image_width: 40\nimage_height: 30\nprojection_matrix:\n  rows: 3\n  cols: 4\n"
               "  data: [60, 0, 20, ") +
           p3 + ", 0, 60, 15, 0, 0, 0, 1, 0]\n";
  };
  write_text(folder.path() / "left.yaml", ros("0"));
  write_text(folder.path() / "right.yaml", ros("-12"));
  BagOptions bags;
  bags.calibration = {(folder.path() / "left.yaml").string(),
                      (folder.path() / "right.yaml").string()};
  CHECK(open_one(path, bags)->info().stereo.params == std::array<double, 5>{60, 60, 20, 15, 0.2});
  CHECK(open_one(path, bags)->read(1).left.pixels == gray_image(0, 2).data);
  bags.calibration.pop_back();
  CHECK(refusal(path, bags)
            .ends_with(
                "left.yaml: is the calibration of one camera; that of the right one must follow"));
  write_text(folder.path() / "chain.yaml",
             "cam0:\n  camera_model: pinhole\n  intrinsics: [60, 60, 20, 15]\n"
             "  distortion_model: radtan\n  distortion_coeffs: [0.05, 0, 0, 0]\n"
             "  resolution: [40, 30]\n"
             "cam1:\n  camera_model: pinhole\n  intrinsics: [60, 60, 20, 15]\n"
             "  distortion_model: radtan\n  distortion_coeffs: [0.05, 0, 0, 0]\n"
             "  resolution: [40, 30]\n"
             "  T_cn_cnm1: [[1, 0, 0, -0.25], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n");
  bags.calibration = {(folder.path() / "chain.yaml").string()};
  const auto raw = open_one(path, bags);
  CHECK(raw->info().stereo.params[4] == Approx(0.25).epsilon(1e-9));
  CHECK(raw->read(1).left.pixels != gray_image(0, 2).data);
  write_text(folder.path() / "orb.yaml",  // as own footage takes it
             "Camera.fx: 60\nCamera.fy: 60\nCamera.cx: 20\nCamera.cy: 15\nCamera.bf: 12\n");
  bags.calibration = {(folder.path() / "orb.yaml").string()};
  CHECK(open_one(path, bags)->info().stereo.params == std::array<double, 5>{60, 60, 20, 15, 0.2});
  bags.calibration.insert(bags.calibration.end(), 2, bags.calibration[0]);
  CHECK(refusal(path, bags).ends_with("orb.yaml: one calibration file too many"));
}

TEST_CASE("the fisheye's images come with the pair of the same time") {
  const TempFolder folder;
  Recording r;
  std::vector<TestMessage> messages = record(r);
  CameraInfoMessage info;
  info.width = kWidth, info.height = kHeight;
  info.distortion_model = "equidistant";
  info.d = {0.01, -0.002, 0.0003, -0.00004};
  info.k = {12, 0, 20, 0, 12.5, 15, 0, 0, 1};
  messages.push_back(
      {"/wrist_fisheye/camera_info", r.info_type, camera_info_bytes(r.wire, 0, info)});
  for (const int frame : {0, 1, 3, 4}) {
    messages.push_back({"/wrist_fisheye/image_raw", r.image_type,
                        image_bytes(r.wire, gray_image(stamp_of(frame) + 2'000'000, 50 + frame))});
  }
  const fs::path path = folder.path() / "some.mcap";
  write_mcap(path, messages, {"lz4", 4, true});
  const auto sequence = open_one(path);
  REQUIRE(sequence->info().fisheye);
  CHECK(sequence->info().fisheye->params ==
        std::array<double, 8>{12, 12.5, 20, 15, 0.01, -0.002, 0.0003, -0.00004});
  CHECK(sequence->read(3).fisheye.pixels == gray_image(0, 53).data);
  CHECK(sequence->read(2).fisheye.empty());
  CHECK(sequence->read(2).fisheye_error == "some: frame 2: no fisheye image");
  CHECK(!open_one(path, {}, SequenceCameras::kStereo)->info().fisheye);
  std::erase_if(messages,
                [](const TestMessage& m) { return m.topic == "/wrist_fisheye/camera_info"; });
  write_mcap(path, messages, {"lz4", 4, true});
  CHECK(refusal(path) ==
        path.string() +
            ": no CameraInfo on /wrist_fisheye/camera_info (--calibration gives it "
            "from a file)");
}

TEST_CASE("what a bag lacks is told in one line") {
  const TempFolder folder;
  const fs::path path = folder.path() / "some.mcap";
  const std::vector<TestMessage> good = record({});
  const auto refusal_of = [&](const std::function<bool(TestMessage&)>& keep) {
    std::vector<TestMessage> messages;
    for (TestMessage message : good) {
      if (keep(message)) messages.push_back(message);
    }
    write_mcap(path, messages, {"none", 4, true});
    return refusal(path);
  };
  const auto is_info = [](const TestMessage& m) { return m.topic.ends_with("camera_info"); };
  const auto with_info = [&](const std::function<void(CameraInfoMessage&)>& change) {
    return refusal_of([&](TestMessage& m) {
      CameraInfoMessage info = rectified_info(m.topic.find("right") != std::string::npos);
      change(info);
      if (is_info(m)) m.bytes = camera_info_bytes({}, 0, info);
      return true;
    });
  };
  CHECK(refusal_of([&](TestMessage& m) { return !is_info(m); })
            .ends_with(": no CameraInfo on /stereo/left/camera_info (--calibration gives it from a "
                       "file)"));
  CHECK(with_info([](CameraInfoMessage& i) { i.k.fill(0); }).find("not calibrated") !=
        std::string::npos);
  CHECK(with_info([](CameraInfoMessage& i) { i.p[3] = 0; }).find("P has no baseline") !=
        std::string::npos);
  // Raw images, whose pair is 1e-200 m or 1e200 m wide.
  for (const double scale : {1e-200, 1e200}) {
    CHECK(with_info([&](CameraInfoMessage& i) {
            i.d[0] = 0.05;
            i.p[3] *= scale;
          }).ends_with("the baseline is zero, or too small or large to be a length"));
  }
  CHECK(with_info([](CameraInfoMessage& i) { i.binning_x = 2; }).find("binning") !=
        std::string::npos);
  CHECK(with_info([](CameraInfoMessage& i) {
          i.width = 50;
        }).ends_with("calibrated for 50x30, but the images are 40x30"));
  CHECK(with_info([](CameraInfoMessage& i) {
          i.d = {1, 2, 3};
        }).ends_with("D must have 4, 5 or 8 numbers"));
  CHECK(with_info([](CameraInfoMessage& i) {
          i.distortion_model = "omni";
          i.d[0] = 1;
        }).find("\"omni\" is not supported") != std::string::npos);
  CHECK(refusal_of([&](TestMessage& m) {
          if (!is_info(m)) m.bytes = image_bytes({}, gray_image(77, 1));
          return true;
        }).find("the times in the headers are all the same (77 ns)") != std::string::npos);
  CHECK(refusal_of([&](TestMessage& m) {
          TestImage image = gray_image(0, 1);
          image.encoding = "nv12";
          if (!is_info(m)) {
            const MessageBytes old{m.bytes, Serialization::kCdr, ""};
            image.stamp = read_stamp(old);
            m.bytes = image_bytes({}, image);
          }
          return true;
        }).find("image encoding \"nv12\" is not known") != std::string::npos);
}

TEST_CASE("images with one time, or that cannot be read, are left out and counted") {
  const TempFolder folder;
  const fs::path path = folder.path() / "some.mcap";
  std::vector<TestMessage> messages = record({});
  messages.push_back(messages[1]);  // the first right image again
  messages.push_back({messages[1].topic, messages[1].type, ByteVector{0, 1, 0, 0, 5, 5}});
  write_mcap(path, messages, {"none", 4, true});
  const auto sequence = open_one(path);
  CHECK(sequence->size() == kFrames);
  REQUIRE(sequence->info().warnings.size() == 2);
  CHECK(sequence->info().warnings[0].starts_with("1 messages cannot be read and are left out"));
  CHECK(sequence->info().warnings[1].ends_with(
      "right/image_raw: 1 images have the time of another one and are left out"));
}

}  // namespace
}  // namespace hybrid_slam
