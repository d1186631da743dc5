#!/usr/bin/env python3
"""H1 from two and three RTSP cameras, and by GStreamer pipelines: every frame that came is tracked, as exactly as from files.

rtsp_test.py HYBRID_SLAM TRAJECTORY_EVAL [CASE...]     the data are in the folder HYBRID_SLAM_DATA

Frames are told apart by their content: those that were recorded are compared with those of the sequence. Needs Debian's packages
ffmpeg, python3-gi, gir1.2-gst-rtsp-server-1.0, gstreamer1.0-plugins-base, -good and -bad, gstreamer1.0-libav.
"""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

PYTHON = "/usr/bin/python3"  # Debian's, which has its packages
RATE = 3  # [Hz]
THUMB = (32, 24)
PATIENCE = 600  # [s]
SIDES = ("left", "right", "fisheye")
IMAGES = {"left": "%d_left.jpg", "right": "%d_right.jpg", "fisheye": "%d_fish.jpg"}
CALIBRATION = {"left": "left_camera.yaml", "right": "right_camera.yaml", "fisheye": "fisheye_calib.yaml"}
LOSSLESS = ["-qp", "0", "-preset", "ultrafast", "-pix_fmt", "gray"]
LOSSY = ["-b:v", "4M", "-maxrate", "4M", "-bufsize", "4M", "-pix_fmt", "yuv420p"]
RTSP = tuple("rtsp://127.0.0.1:{rtsp}/" + side for side in SIDES[:2])
RTSP_HYBRID = tuple("rtsp://127.0.0.1:{rtsp}/" + side for side in SIDES)
PIPELINE = tuple("tcpclientsrc host=127.0.0.1 port={%s} ! h264parse ! avdec_h264 ! videoconvert ! appsink sync=false" % side
                 for side in SIDES[:2])
CASES = {  # options of the encoder, the streams, whether they are cut; ATE at most [cm], or none: 1.2 times that of files
    "rtsp_lossless": (LOSSLESS, RTSP, False, None),
    "rtsp_4M_cut": (LOSSY, RTSP, True, 0.1),
    "hybrid_lossless": (LOSSLESS, RTSP_HYBRID, False, None),
    "hybrid_4M": (LOSSY, RTSP_HYBRID, False, 0.1),
    "gstreamer_lossless": (LOSSLESS, PIPELINE, False, None),
    "gstreamer_4M": (LOSSY, PIPELINE, False, 0.1),
}


def skip(reason):
    print("SKIPPED: " + reason)
    sys.exit(0)


def check(truth, what):
    if not truth:
        sys.exit("failed: " + what)


def run(command, **options):
    return subprocess.run(command, check=True, capture_output=True, **options).stdout


def needs():
    if not os.environ.get("HYBRID_SLAM_DATA"):
        skip("HYBRID_SLAM_DATA is not set")
    probe = ("import gi; gi.require_version('Gst', '1.0'); gi.require_version('GstRtspServer', '1.0')\n"
             "from gi.repository import Gst, GstRtspServer; Gst.init(None)\n"
             "assert all(Gst.ElementFactory.find(name) for name in ('tcpclientsrc', 'h264parse', 'avdec_h264', 'rtph264pay'))")
    for command in (["ffmpeg", "-version"], [PYTHON, "-c", probe]):
        try:
            run(command)
        except (OSError, subprocess.CalledProcessError):
            skip("needs ffmpeg, python3-gi, gir1.2-gst-rtsp-server-1.0, gstreamer1.0-plugins-base, -good and -bad, gstreamer1.0-libav")


def encode(images, frames, side, options, path):
    """The first picture three times, then all of them; groups of three."""
    listed = path + ".txt"
    with open(listed, "w", encoding="utf-8") as file:
        for i in [0, 0, 0, *range(frames)]:
            file.write("file '%s'\n" % os.path.join(images, IMAGES[side] % i))
    run(["ffmpeg", "-v", "error", "-r", str(RATE), "-f", "concat", "-safe", "0", "-i", listed, "-vf", "format=gray", "-c:v", "libx264",
         *options, "-bf", "0", "-g", "3", "-x264-params", "aud=1:scenecut=0", "-r", str(RATE), "-f", "h264", path])


def thumbs(pattern_options):
    size = THUMB[0] * THUMB[1]
    data = run(["ffmpeg", "-v", "error", *pattern_options, "-vf", "format=gray,scale=%d:%d:flags=area" % THUMB, "-f", "rawvideo", "-pix_fmt",
                "gray", "-fps_mode", "passthrough", "-"])
    return [data[i:i + size] for i in range(0, len(data), size)]


def normal(thumb):
    """Without brightness and contrast, which decoders change."""
    mean = sum(thumb) / len(thumb)
    sigma = (sum((value - mean) ** 2 for value in thumb) / len(thumb)) ** 0.5
    return [(value - mean) / max(sigma, 1e-3) for value in thumb]


class Cameras:
    """The server, in a process of its own."""

    def __init__(self, port, files, start):
        script = os.path.join(os.path.dirname(os.path.abspath(__file__)), "camera_streams.py")
        self.process = subprocess.Popen([PYTHON, script, str(port), str(RATE), str(start), *files], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        check(self.process.stdout.readline() == "ready\n", "the cameras are there")

    def go(self):
        self.process.stdin.write("go\n")
        self.process.stdin.flush()

    def stop(self):
        self.process.kill()
        self.process.wait()


class Slam:
    def __init__(self, program, dataset, streams, folder):
        command = [program, "live", "--record", "kept", "--timeout", "60", "--out", "out", "--quiet"]
        for side, stream in streams.items():
            command += ["--" + side, stream]
        command += ["--calibration", *(os.path.join(dataset, "calibration", CALIBRATION[side]) for side in streams)]
        self.process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.said, self.changed = "", threading.Condition()
        self.listener = threading.Thread(target=self.listen, daemon=True)
        self.listener.start()

    def listen(self):
        for line in self.process.stderr:
            with self.changed:
                self.said += line
                self.changed.notify_all()

    def wait_for(self, text):
        with self.changed:
            check(self.changed.wait_for(lambda: text in self.said or self.process.poll() is not None, PATIENCE) and text in self.said,
                  "it says \"%s\", not \"%s\"" % (text, self.said))

    def core_times(self):
        """How long its threads ran, and how long they waited for a core, all together [s]."""
        tasks = "/proc/%d/task" % self.process.pid
        ran = waited = 0
        for task in os.listdir(tasks):
            with open(os.path.join(tasks, task, "schedstat"), encoding="utf-8") as file:
                times = file.read().split()
            ran += int(times[0]) / 1e9
            waited += int(times[1]) / 1e9
        return ran, waited

    def end(self):
        self.process.send_signal(signal.SIGINT)
        check(self.process.wait(PATIENCE) == 0, "exit code %s: %s" % (self.process.returncode, self.said))
        self.listener.join()


def ate_cm(evaluate, trajectory, truth):
    text = run([evaluate, "ate", trajectory, truth], text=True)
    return 100 * float(re.search(r"rmse +([0-9.e-]+)", text).group(1))


def by_content(folder, images, frames):
    """stereo.tum with the times of the sequence: each of its frames once. Also how far off their contents are [grey levels, median]."""
    names = sorted(os.listdir(os.path.join(folder, "kept", "left")))
    kept = thumbs(["-f", "image2", "-pattern_type", "glob", "-i", os.path.join(folder, "kept", "left", "*.png")])
    source = thumbs(["-f", "image2", "-start_number", "0", "-i", os.path.join(images, IMAGES["left"])])[:frames]
    shapes = [normal(thumb) for thumb in source]
    check(len(kept) == len(names), "all that were recorded")
    with open(os.path.join(folder, "out", "stereo.tum"), encoding="utf-8") as file:
        poses = [line.split() for line in file if not line.startswith("#")]
    found, off = {}, []
    for name, thumb in zip(names, kept):
        shape = normal(thumb)
        _, index = min((sum(abs(a - b) for a, b in zip(shape, other)), i) for i, other in enumerate(shapes))
        off.append(sum(abs(a - b) for a, b in zip(thumb, source[index])) / len(thumb))
        pose = min(poses, key=lambda line: abs(float(line[0]) - int(name[:-4]) / 1e9))
        if abs(float(pose[0]) - int(name[:-4]) / 1e9) < 1e-3:
            found[index] = pose[1:]
    path = os.path.join(folder, "by_content.tum")
    with open(path, "w", encoding="utf-8") as file:
        for index, pose in sorted(found.items()):
            file.write("%.6f %s\n" % (index / RATE, " ".join(pose)))
    return path, found, sorted(off)[len(off) // 2]


def try_case(name, program, evaluate, dataset, frames, of_files):
    options, streams, cut, at_most = CASES[name]
    images, truth = os.path.join(dataset, "H1", "images", "raw"), os.path.join(dataset, "H1", "gt_left_tum.txt")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with tempfile.TemporaryDirectory() as folder:
        sides = SIDES[:len(streams)]
        files = [os.path.join(folder, side + ".h264") for side in sides]
        for side, path in zip(sides, files):
            encode(images, frames, side, options, path)
        cameras = Cameras(port, files, 3)
        names = [stream.format(rtsp=port, left=port + 1, right=port + 2) for stream in streams]
        slam = Slam(program, dataset, dict(zip(sides, names)), folder)
        try:
            for side in sides[1:]:
                slam.wait_for(side + "'s images come")
            cameras.go()
            if cut:
                time.sleep(frames / 3 / RATE)
                cameras.stop()
                time.sleep(5)
                cameras = Cameras(port, files, 3 + frames // 2 // 3 * 3)  # they went on meanwhile
                slam.wait_for("camera is back after")
                cameras.go()
            check(cameras.process.stdout.readline() == "over\n", "all was sent")
            time.sleep(3)  # what a decoder holds
            ran, waited = slam.core_times()
            slam.end()
        finally:
            cameras.stop()
            slam.process.kill()
            slam.process.wait()
        with open(os.path.join(folder, "out", "summary.json"), encoding="utf-8") as file:
            summary = json.load(file)
        path, found, off = by_content(folder, images, frames)
        ate = ate_cm(evaluate, path, truth)
    live, counts = summary["live"], summary["frames"]
    print("%s: %d sets, %d tracked, %d lost, %d dropped + %s before; %d of %d frames of the sequence, ATE %.4f cm (files: %.4f); grey levels off by %.2f" % (
        name, live["sets"], counts["tracked"], counts["lost"], counts["dropped"], live["dropped"], len(found), frames, ate, of_files, off))
    print("    lost streams: %s; held up: %s; alone: %s; its threads ran for %.1f s and waited %.1f s for a core" % (
        live["lost"], live["held_up"], live["alone"], ran, waited), flush=True)
    if len(sides) == 3:
        fisheye = summary["fisheye"]["frames"]
        print("    fisheye: %d of %d registered" % (fisheye["registered"], fisheye["read"]), flush=True)
        check(fisheye["read"] > frames // 2 and fisheye["registered"] == fisheye["read"], "the fisheye is tracked")
    check(counts["lost"] == 0, "no frame is lost")
    check(counts["tracked"] == counts["read"] - counts["corrupt"], "what was not dropped is tracked")
    check(counts["dropped"] == 0 or waited > ran, "nothing is dropped unless others have the cores")
    check(live["lost"]["left"] >= int(cut), "a stream that is cut is said to be lost")
    check(cut or len(found) + counts["dropped"] + sum(live["dropped"].values()) >= frames - 6, "all frames came: %s" % sorted(found))
    check(not cut or max(found) > frames // 2, "it goes on")
    check(ate <= (at_most if at_most else 1.2 * of_files), "as exact as it must be")


def main():
    program, evaluate, cases = sys.argv[1], sys.argv[2], sys.argv[3:] or list(CASES)
    needs()
    dataset = os.path.join(os.environ["HYBRID_SLAM_DATA"], "uwsynth", "hybrid")
    if not os.path.isdir(dataset):
        skip("there is no " + dataset)
    frames = int(os.environ.get("FRAMES", 120))
    with tempfile.TemporaryDirectory() as folder:
        run([program, dataset, "--sequence", "H1", "--cameras", "stereo", "--limit", str(frames), "--out", folder, "--quiet"])
        with open(os.path.join(folder, "summary.json"), encoding="utf-8") as file:
            of_files = 100 * json.load(file)["ate"]["position_m"]["rmse"]
    for name in cases:
        try_case(name, program, evaluate, dataset, frames, of_files)


main()
