#include "frontend/input/footage.h"

#include <iostream>

#include "frontend/input/child_output.h"
#include "frontend/input/footage_calibration.h"
#include "frontend/input/footage_images.h"
#include "frontend/input/part_of_sequence.h"
#include "test/frontend/input/dataset_writer.h"
#include "test/frontend/input/small_footage.h"

namespace hybrid_slam {
namespace {

using namespace small_footage;

struct Listed {
  NameOrder order;
  std::vector<std::int64_t> keys;
};

Listed listed(const Names& names) {
  const TempFolder folder;
  write_images(folder.path(), names, 0);
  const FootageList list = list_footage({folder.path().string()});
  Listed result{list.order, {}};
  for (const FootageImage& image : list.images) result.keys.push_back(image.key);
  return result;
}

TEST_CASE("Own footage: what names of images tell") {
  CHECK(listed({"left_0010", "left_0011", "left_0009"}).keys == Keys{9, 10, 11});
  CHECK(listed({"left_0010", "left_0011"}).order == NameOrder::kNumbers);
  CHECK(listed({"9", "10", "100"}).keys == Keys{9, 10, 100});
  CHECK(listed({"cam0_7_left", "cam0_8_left"}).keys == Keys{7, 8});

  const Listed nano = listed({"1403636579763555584", "1403636579813555456"});
  CHECK(nano.order == NameOrder::kStamps);
  CHECK(nano.keys == Keys{1403636579763555584, 1403636579813555456});
  CHECK(listed({"1403636579763555", "1403636579813555"}).keys ==
        Keys{1403636579763555000, 1403636579813555000});
  CHECK(listed({"1403636579763", "1403636579813"}).keys ==
        Keys{1403636579763000000, 1403636579813000000});
  // Seconds, also where only the fraction changes.
  CHECK(listed({"1403636579.763556", "1403636580.813556"}).keys ==
        Keys{1403636579763556000, 1403636580813556000});
  CHECK(listed({"frame-1403636579.763556", "frame-1403636579.813556"}).keys ==
        Keys{1403636579763556000, 1403636579813556000});
  CHECK(listed({"0.05", "12.5"}).keys == Keys{50000000, 12500000000});
  CHECK(listed({"1403636579_763556", "1403636580_013556"}).keys ==
        Keys{1403636579763556000, 1403636580013556000});
  // Not every point is a decimal one.
  CHECK(listed({"cam0.0001", "cam0.0002"}).keys == Keys{1, 2});
  // Several numbers: the order of the names.
  const Listed named = listed({"dive1_part1_03", "dive1_part2_01", "dive2_part1_02"});
  CHECK(named.order == NameOrder::kNames);
  CHECK(named.keys == Keys{0, 1, 2});
  check_holds(complaint([] { listed({"1", "01"}); }), "same number as");
}

TEST_CASE("Own footage: the same frames as KITTI's layout") {
  const TempFolder folder;
  const fs::path sequence = folder.path() / "sequences/07";
  write_images(sequence / "image_0", kThree, 0);
  write_images(sequence / "image_1", kThree, 1);
  write_text(sequence / "calib.txt", kitti_calibration());
  write_text(sequence / "times.txt", "0\n0.5\n1.25\n");
  const auto dataset = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  Footage footage;
  footage.left = {(sequence / "image_0").string()};
  footage.right = {(sequence / "image_1/*.png").string()};  // a folder or a pattern
  footage.calibration = {(sequence / "calib.txt").string()};
  footage.times = (sequence / "times.txt").string();
  check_same_frames(*dataset, *open_rectified(footage));
  CHECK_FALSE(footage_meanings(footage).raw);

  // Its colour cameras have a baseline of their own: (4 + 12) / 80.
  fs::rename(sequence / "image_0", sequence / "image_2");
  fs::rename(sequence / "image_1", sequence / "image_3");
  footage.left = {(sequence / "image_2").string()};
  footage.right = {(sequence / "image_3").string()};
  CHECK(open_rectified(footage)->info().stereo.params[4] == Approx(0.2).margin(1e-12));
}

TEST_CASE("Own footage: the same frames as EuRoC's layout") {
  const TempFolder folder;
  const Names names{"1403636579763555584", "1403636579813555456", "1403636579863555584"};
  for (int side = 0; side < 2; ++side) {
    const fs::path camera = folder.path() / (side == 0 ? "mav0/cam0" : "mav0/cam1");
    write_images(camera / "data", names, side);
    std::string list = "#timestamp [ns],filename\n";
    for (const std::string& name : names) list += name + "," + name + ".png\n";
    write_text(camera / "data.csv", list);
    write_text(camera / "sensor.yaml", sensor(0.12 * side, 0.02 * side));
  }
  const auto dataset = open_sequence(folder.path().string(), SequenceLayout::kAuto, "");
  const fs::path mav = folder.path() / "mav0";
  Footage footage;
  footage.left = {(mav / "cam0/data").string()};
  footage.right = {(mav / "cam1/data").string()};
  footage.calibration = {(mav / "cam0/sensor.yaml").string(), (mav / "cam1/sensor.yaml").string()};
  const auto own = open_footage(footage, FootageImages::kRaw, {});
  check_same_frames(*dataset, *own);
  CHECK(own->info().times[0] == Approx(1403636579.763555584).epsilon(1e-15));
  CHECK_FALSE(footage_meanings(footage).rectified);
  check_holds(refusal_of(footage), "says how raw images are made");
  footage.calibration.pop_back();
  check_holds(refusal_of(footage, FootageImages::kRaw), "that of the right one must follow");
}

TEST_CASE("Own footage: times") {
  const TempFolder folder;
  Footage footage = write_footage(folder.path(), {"left_010", "left_012", "left_013"});
  check_holds(refusal_of(footage), "the names tell no times; give --times FILE");
  footage.rate = 20;  // gaps between numbers stay
  CHECK(open_rectified(footage)->info().times == std::vector<double>{0, 0.1, 0.15});
  footage.rate = 0;
  footage.times = (folder.path() / "t").string();
  write_text(footage.times, "7\n8.5\n9\n");  // as many as frames
  CHECK(open_rectified(footage)->info().times == std::vector<double>{7, 8.5, 9});
  std::string rows;
  for (int i = 0; i < 20; ++i) rows += std::to_string(0.5 * i) + "\n";
  write_text(footage.times, rows);  // row n is that of number n
  CHECK(open_rectified(footage)->info().times == std::vector<double>{5, 6, 6.5});
  write_text(footage.times,
             "# time name\n1.5 left_010.png\n1.75 left_011.png\n2 left_012.png\n3 left_013.png\n");
  CHECK(open_rectified(footage)->info().times == std::vector<double>{1.5, 2, 3});
  write_text(footage.times,
             "timestamp,filename\n1403636579763555584,left_010.png\n"
             "1403636579813555584,left_012.png\n1403636579863555584,left_013.png\n");
  CHECK(open_rectified(footage)->info().times[1] == Approx(1403636579.813555584).epsilon(1e-15));
  write_text(footage.times,
             "#timestamp [ns],filename\n1000000000,left_010.png\n1100000000,left_012.png\n"
             "1200000000,left_013.png\n");
  CHECK(open_rectified(footage)->info().times[1] == Approx(1.1));
  // The name first, and an exposure behind.
  write_text(footage.times, "left_010 1.5 6.9\nleft_012 2.0 7.1\nleft_013 3.25 7\n");
  CHECK(open_rectified(footage)->info().times == std::vector<double>{1.5, 2, 3.25});
  write_text(footage.times, "2011-09-26 13:02:25.5\n2011-09-26 13:02:26\n2011-09-26 13:02:27\n");
  CHECK(open_rectified(footage)->info().times[0] == 1317042145.5);

  write_text(footage.times, "1\n2\n");
  check_holds(refusal_of(footage), "has 2 times for 3 frames of numbers 10 to 13");
  write_text(footage.times, "1.5 left_010.png\n2 left_012.png\n");
  check_holds(refusal_of(footage), "has no time of the left image \"left_013.png\"");
  write_text(footage.times, "1.5 left_010.png\n1 left_012.png\n3 left_013.png\n");
  check_holds(refusal_of(footage), "the times of frames 0 and 1 do not ascend");
}

TEST_CASE("Own footage: left, right and fisheye belong together by number or time") {
  const TempFolder folder;
  Footage footage = write_footage(folder.path(), {"000000", "000001", "000002", "000003"});
  footage.rate = 5;
  fs::remove(folder.path() / "right/000002.png");
  const auto sequence = open_rectified(footage);
  REQUIRE(sequence->size() == 4);
  CHECK(holds(sequence->read(3).right, picture_of(3, 1)));
  check_holds(complaint([&] { sequence->read(2); }), "no right image");

  write_images(folder.path() / "fish", {"000000", "000003"}, 2);
  footage.fisheye = {(folder.path() / "fish").string()};
  check_holds(refusal_of(footage), "that of the fisheye must follow");
  const std::string lens = (folder.path() / "lens.yaml").string();
  write_text(lens,
             "image_width: 96\nimage_height: 64\nfx: 30\nfy: 30\ncx: 47\ncy: 31\nk1: 0\n"
             "k2: 0\nk3: 0\nk4: 0\n");
  footage.calibration.push_back(lens);
  const auto hybrid = open_rectified(footage);
  REQUIRE(hybrid->info().fisheye);
  CHECK(hybrid->info().fisheye->params[0] == 30);
  CHECK(holds(hybrid->read(3).fisheye, picture_of(1, 2)));
  CHECK(hybrid->read(1).fisheye.empty());
  footage.fisheye.clear();
  check_holds(refusal_of(footage), "lens.yaml: is one calibration too many");

  // Times in the names: a constant offset is taken out, what has no partner left out.
  fs::remove_all(folder.path() / "left");
  fs::remove_all(folder.path() / "right");
  write_images(folder.path() / "left", {"100.00", "100.10", "100.20", "100.30"}, 0);
  write_images(folder.path() / "right", {"100.004", "100.204", "100.304"}, 1);
  footage.calibration.pop_back();
  footage.rate = 0;
  const auto stamped = open_rectified(footage);
  REQUIRE(stamped->size() == 3);
  CHECK(stamped->info().times[0] == Approx(100).epsilon(1e-14));
  CHECK(stamped->info().times[1] == Approx(100.2).epsilon(1e-14));
  CHECK(holds(stamped->read(1).left, picture_of(2, 0)));
  CHECK(holds(stamped->read(1).right, picture_of(1, 1)));

  fs::remove_all(folder.path() / "right");
  write_images(folder.path() / "right", {"7", "8", "9", "10"}, 1);
  check_holds(refusal_of(footage),
              "the names of the left images tell times (100.00.png), those of "
              "the right ones numbers (7.png)");
}

TEST_CASE("Own footage: videos") {
  const TempFolder folder;
  const Names names{"000000", "000001", "000002", "000003", "000004"};
  Footage images = write_footage(folder.path(), names);
  images.rate = 8;
  Footage videos = images;
  videos.rate = 0;
  for (const char* const side : {"left", "right"}) {
    const std::string video = (folder.path() / side).string() + ".mkv";
    try {
      std::string ignored;
      ChildOutput made({"ffmpeg", "-v", "quiet", "-framerate", "8", "-i",
                        (folder.path() / side / "%06d.png").string(), "-c:v", "ffv1", "-pix_fmt",
                        "gray", video});
      REQUIRE(made.read_to_end(ignored));
    } catch (const InputError& error) {
      std::cout << "SKIPPED: " << error.what() << "\n";
      return;
    }
    (side == std::string("left") ? videos.left : videos.right) = {video};
  }
  const auto as_images = open_rectified(images);
  const auto sequence = open_rectified(videos);
  REQUIRE(sequence->size() == names.size());
  CHECK(sequence->info().stereo.params == as_images->info().stereo.params);
  for (const std::size_t frame : {0, 2, 3, 1, 4, 4}) {  // back, too
    CHECK(sequence->info().times[frame] == Approx(0.125 * static_cast<double>(frame)).margin(1e-9));
    CHECK(sequence->read(frame).left.pixels == as_images->read(frame).left.pixels);
    CHECK(sequence->read(frame).right.pixels == as_images->read(frame).right.pixels);
  }
  videos.rate = 16;
  CHECK(open_rectified(videos)->info().times[3] == Approx(3.0 / 16));
  videos.rate = 0;
  videos.times = (folder.path() / "t").string();
  write_text(videos.times, "1\n2\n4\n8\n16\n");
  CHECK(open_rectified(videos)->info().times[4] == 16);
  videos.right = {(folder.path() / "right").string()};
  check_holds(refusal_of(videos), "right: must be one video, as the left one is");
  write_text(folder.path() / "left.mkv", "no video");
  check_holds(refusal_of(videos), "left.mkv: is no video that can be read");
}

TEST_CASE("Own footage: what cannot be used is refused in one line") {
  const TempFolder folder;
  Footage footage = write_footage(folder.path(), kThree);
  footage.rate = 5;
  SECTION("no such folder") {
    footage.right = {(folder.path() / "rihgt").string()};
    check_holds(refusal_of(footage), "rihgt: no such folder or file");
  }
  SECTION("nothing matches") {
    footage.left = {(folder.path() / "left/*.jpg").string()};
    check_holds(refusal_of(footage), "*.jpg: holds no images");
  }
  SECTION("the calibration of something else") {
    write_text(footage.calibration[0], "fx: 3\n");
    check_holds(refusal_of(footage), "calib.txt: is not the calibration of a stereo pair (KITTI's");
  }
  SECTION("raw images of which only the rectified pair is known") {
    check_holds(refusal_of(footage, FootageImages::kRaw),
                "does not tell how to rectify raw images");
  }
  SECTION("names without one number, and not as many") {
    write_images(folder.path() / "left", {"a1b1", "a2b2"}, 0);
    fs::remove(folder.path() / "left/000000.png");
    fs::remove_all(folder.path() / "right");
    write_images(folder.path() / "right", {"a1b1", "a2b2"}, 1);
    check_holds(refusal_of(footage), "names do not tell which belong together");
  }
  SECTION("the same images twice") {
    footage.right = footage.left;
    check_holds(refusal_of(footage), "left/000000.png: is a left and a right image");
  }
  SECTION("another size") {
    write_text(folder.path() / "l.yaml", ros(0, 0, 0));
    write_text(folder.path() / "r.yaml", ros(-9.6, 0, 0));
    replace_text(folder.path() / "l.yaml", "image_width: 96", "image_width: 192");
    replace_text(folder.path() / "r.yaml", "image_width: 96", "image_width: 192");
    footage.calibration = {(folder.path() / "l.yaml").string(),
                           (folder.path() / "r.yaml").string()};
    check_holds(refusal_of(footage), "calibrated for 192x64, but the images are 96x64");
  }
}

TEST_CASE("A part of a sequence") {
  const TempFolder folder;
  Footage footage =
      write_footage(folder.path(), {"0", "1", "2", "3", "4", "5", "6", "7", "8", "9"});
  footage.rate = 10;
  const auto part = part_of_sequence(open_rectified(footage), 3, 2);
  REQUIRE(part->size() == 4);  // 3, 5, 7, 9
  CHECK(part->info().times[1] == 0.5);
  const FrameImages images = part->read(2);
  CHECK(images.frame_index == 2);
  CHECK(images.time == 0.7);
  CHECK(holds(images.right, picture_of(7, 1)));
  CHECK(part_of_sequence(open_rectified(footage), 3, 2, 2)->size() == 2);
  CHECK(part_of_sequence(open_rectified(footage), 9, 5)->size() == 1);
  check_holds(complaint([&] { part_of_sequence(open_rectified(footage), 10, 1); }),
              "left: has 10 frames; there is no frame 10 to start with");
}

}  // namespace
}  // namespace hybrid_slam
