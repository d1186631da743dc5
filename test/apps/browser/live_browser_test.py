#!/usr/bin/env python3
"""Opens the page of a run while it goes on, and of the finished run, in a browser without a window.

live_browser_test.py chromium|firefox HYBRID_SLAM MAP_TOOL [PICTURES]     the data are in the folder HYBRID_SLAM_DATA

PICTURES: a folder for screenshots. The run watches a folder into which this test puts images: it goes on for as long as
there is something to look at, however busy the machine is.
"""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from browsers import check, free_port, h1, json_of, open_browser, program_of, rows_of, SIZES, wait_for_server

FIRST, SECOND, ALL = 6, 24, 30  # images of each camera: before anybody looks, then, and in the end
WAITING = 2  # of them wait for others that may come late, of a time before theirs


def same(value, text):
    return (value is None or value != value) if text == "" else abs(value - float(text)) <= 1e-5 * abs(float(text))


# The page's frames, as lines of frames.csv.
FRAMES = """[...Array(frames.count).keys()].map(i => ({camera: CAMERAS[frames.camera[i]], time: frames.time[i],
  state: stateOf(i), inliers: frames.inliers[i], features: frames.features[i], sigma: frames.sigma_position[i] || null,
  pose: hasPose(i)}))"""


def check_frames(shown, rows):
    check(len(shown) == len(rows), "%d frames of %d" % (len(shown), len(rows)))
    for frame, row in zip(shown, rows):
        where = "%s %s" % (row["camera"], row["time"])
        check(frame["camera"] == row["camera"] and frame["state"] == row["state"], where)
        check(abs(frame["time"] - float(row["time"])) < 1e-6, where)
        check(same(frame["inliers"], row["inliers"]) and same(frame["features"], row["features"]), where)
        check(frame["pose"] == (row["tx"] != ""), where + ": pose")


class Dive:
    """A folder that a recorder writes to."""

    def __init__(self, dataset, folder):
        self.images, self.folder = os.path.join(dataset, "H1", "images", "raw"), os.path.join(folder, "dive")
        for camera in ("left", "right", "fisheye"):
            os.makedirs(os.path.join(self.folder, camera))

    def put(self, first, last):
        for i in range(first, last):
            for camera in ("left", "right", "fisheye"):
                place = os.path.join(self.folder, camera)
                shutil.copy(os.path.join(self.images, "%d_%s.jpg" % (i, camera.replace("fisheye", "fish"))),
                            os.path.join(place, ".coming"))
                os.rename(os.path.join(place, ".coming"),
                          os.path.join(place, "%d.jpg" % (1764432000 * 10**9 + i * 10**9 // 3)))


def look_at_live(browsers, program, dataset, folder, pictures):
    port = free_port()
    url = "http://127.0.0.1:%d/" % port
    dive, calibration = Dive(dataset, folder), os.path.join(dataset, "calibration")
    run = subprocess.Popen(
        [program, "live", "--watch", "dive", "--mode", "every-frame", "--view", str(port), "--out", "out", "--quiet", "--calibration",
         *(os.path.join(calibration, name) for name in ("left_camera.yaml", "right_camera.yaml", "fisheye_calib.yaml"))],
        stdout=subprocess.DEVNULL, cwd=folder)
    try:
        dive.put(0, FIRST)
        wait_for_server(port)
        for browser in browsers.values():
            browser.open(url)
        for browser in browsers.values():
            browser.wait_for("frames.count >= %d" % (2 * (FIRST - WAITING)))
        dive.put(FIRST, SECOND)
        for browser in browsers.values():
            browser.wait_for("frames.count >= %d" % (2 * (SECOND - WAITING)))
            browser.wait_for("data.landmarks.count > 500 && data.keyframes.count > 1")
            browser.wait_for("[...document.querySelectorAll('.now-picture img')].filter(one => !one.hidden).length == 2")
            browser.wait_for("document.querySelector('[data-now=stereo] .now-state').textContent == 'ON THE MAP'")
            browser.wait_for("document.querySelectorAll('#timeline svg').length > 0")
            # Nothing new comes: a pilot must see that.
            browser.wait_for("document.documentElement.dataset.live === 'alarm' && "
                             "document.getElementById('now-status').textContent.startsWith('NOTHING NEW')")
        dive.put(SECOND, ALL)
        for name, browser in browsers.items():
            browser.wait_for("frames.count >= %d" % (2 * (ALL - WAITING)))
            check(browser.value("document.documentElement.dataset.delayMs !== undefined"), "how late the page is")
            if pictures:
                time.sleep(1.5)
                browser.screenshot(os.path.join(pictures, "live_%s.png" % name))
        run.send_signal(signal.SIGINT)
        check(run.wait(timeout=600) == 0, "the run ends well")
        summary = json_of(os.path.join(folder, "out", "summary.json"))
        for browser in browsers.values():
            browser.wait_for("document.documentElement.dataset.live === 'over'")
            check("results are in out" in browser.value("document.getElementById('now-status').textContent"), "where the results are")
            check_frames(browser.value(FRAMES), rows_of(os.path.join(folder, "out", "frames.csv")))
            for what in ("keyframes", "landmarks"):
                shown = browser.value("data.%s.count" % what)
                check(shown == summary[what], "%d %s on the page, %d in the summary" % (shown, what, summary[what]))
            print("from a frame's result to the page: median %s ms" % browser.value("document.documentElement.dataset.delayMs"))
            browser.check_quiet(url)
    finally:
        run.kill()
        run.wait()


def look_at_finished(browser, program, tool, dataset, folder, pictures):
    out = os.path.join(folder, "finished")
    subprocess.run([program, dataset, "--sequence", "H1", "--limit", "12", "--out", out, "--quiet"], check=True,
                   stdout=subprocess.DEVNULL)
    port = free_port()
    url = "http://127.0.0.1:%d/" % port
    viewer = subprocess.Popen([tool, "view", out, "--port", str(port)], stdout=subprocess.DEVNULL)
    try:
        wait_for_server(port)
        browser.open(url)
        rows, summary = rows_of(os.path.join(out, "frames.csv")), json_of(os.path.join(out, "summary.json"))
        check_frames(browser.value(FRAMES), rows)
        check(browser.value("data.landmarks.count") == summary["landmarks"], "all landmarks")
        browser.value("document.querySelector('.player button').click()")
        browser.wait_for("selection.frame >= 3")
        browser.value("document.querySelector('.player button').click()")
        browser.value("selection.set(20)")
        browser.wait_for("[...document.querySelectorAll('figcaption[data-time]')].length == 2 && "
                         "[...document.querySelectorAll('figcaption[data-time]')].every(one => "
                         "Math.abs(one.dataset.time - %r) < 1e-3)" % float(rows[20]["time"]))
        check(browser.value("document.querySelector('[data-now=stereo] .now-state').dataset.state") == rows[20]["state"],
              "the chosen frame's state")
        if pictures:
            time.sleep(1)
            browser.screenshot(os.path.join(pictures, "finished.png"))
    finally:
        viewer.send_signal(signal.SIGINT)
        check(viewer.wait(timeout=60) == 0, "Ctrl-C ends it in order")
    browser.check_quiet(url)


def main():
    kind, program, tool = sys.argv[1:4]
    pictures = sys.argv[4] if len(sys.argv) > 4 else ""
    program_of(kind)
    dataset = h1()
    with tempfile.TemporaryDirectory() as folder:
        browsers = {}
        try:
            for name in SIZES if kind == "chromium" else ["desktop"]:
                browsers[name] = open_browser(kind, folder, name)
            look_at_live(browsers, program, dataset, folder, pictures)
            for name in list(browsers):
                browsers.pop(name).close()
            browsers["finished"] = open_browser(kind, folder)
            look_at_finished(browsers["finished"], program, tool, dataset, folder, pictures)
        finally:
            for browser in browsers.values():
                browser.close()


main()
