#!/usr/bin/env python3
"""Opens the report of a short run in a browser without a window: sections, counts, values, errors, requests, time.

report_browser_test.py chromium|firefox HYBRID_SLAM [PICTURES]     the data are in the folder HYBRID_SLAM_DATA

PICTURES: a folder for screenshots.
"""

import base64
import json
import os
import random
import re
import struct
import subprocess
import sys
import tempfile

from browsers import Chromium, check, cpu_seconds, h1, json_of, open_browser, program_of

SECTIONS = ("map", "timeline", "coverage", "calibration", "loops", "truth", "time", "run")
LANDMARKS = 100_000


def flattened(value, prefix=""):
    if isinstance(value, dict) and value:
        for key, part in value.items():
            yield from flattened(part, prefix + "." + key if prefix else key)
    elif isinstance(value, list) and value:
        for index, part in enumerate(value):
            yield from flattened(part, "%s.%d" % (prefix, index))
    else:
        yield prefix, value


def check_values(browser, summary):
    shown = browser.value("Object.fromEntries([...document.querySelectorAll('[data-key]')].map(one => [one.dataset.key, one.textContent]))")
    values = dict(flattened(summary))
    for key, value in values.items():
        check(key in shown, "%s is shown" % key)
        if isinstance(value, bool):
            check(shown[key] == str(value).lower(), "%s: %s" % (key, shown[key]))
        elif isinstance(value, (int, float)):
            check(abs(float(shown[key]) - value) <= 1e-12 * abs(value), "%s: %s is not %s" % (key, shown[key], value))
        elif isinstance(value, str):
            check(shown[key] == value, "%s: %s is not %s" % (key, shown[key], value))
    check(len(values) > 80, "%d values of summary.json" % len(values))
    return len(values)


def data_of(html):
    return json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', html, re.S).group(1))


def with_many_landmarks(html):
    """The same page with so many landmarks as a large map has, on a hilly ground of 20 m x 10 m."""
    chance = random.Random(1)
    data = data_of(html)

    def array(kind, code, values):
        return {"type": kind, "data": base64.b64encode(struct.pack("<%d%s" % (len(values), code), *values)).decode()}

    places = [part for _ in range(LANDMARKS) for part in (chance.uniform(-10, 10), chance.gauss(1.5, 0.1), chance.uniform(-5, 5))]
    data["landmarks"].update(
        count=LANDMARKS, of=LANDMARKS, position=array("f32", "f", places),
        camera=array("u8", "B", [chance.randrange(2) for _ in range(LANDMARKS)]),
        views=array("u8", "B", [chance.randrange(2, 40) for _ in range(LANDMARKS)]),
        born=array("u16", "H", [chance.randrange(65536) for _ in range(LANDMARKS)]),
        sigma=array("u16", "H", [chance.randrange(1, 5000) for _ in range(LANDMARKS)]))
    at, end = html.index('application/json">') + 18, html.index("</script>")
    return html[:at] + json.dumps(data).replace("<", "\\u003c") + html[end:]


def check_map(browser):
    """The canvas keeps what was drawn: pixels that are not the ground's colour."""
    if browser.value("document.createElement('canvas').getContext('webgl') === null"):
        check("shows no WebGL" in browser.value("document.getElementById('map').textContent"), "why there is no map")
        print("this browser has no WebGL here: that the map is drawn was not tested")
        return
    drawn = browser.value("""(() => { const canvas = document.getElementById('map-canvas'), gl = canvas.getContext('webgl'),
      pixels = new Uint8Array(4 * canvas.width * canvas.height);
      gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      let other = 0;
      for (let i = 0; i < pixels.length; i += 4) other += pixels[i] != pixels[0] || pixels[i + 1] != pixels[1];
      return other; })()""")
    check(drawn > 1000, "the map is drawn: %d pixels" % drawn)


def check_coverage(browser):
    """The place under the pointer is told, and a click there chooses a frame."""
    browser.value("selection.set(frames.count - 1)")
    told, chosen = browser.value("""(() => { const picture = document.querySelector('.grid-box svg'), box = picture.getBoundingClientRect(),
      at = {clientX: box.left + box.width / 2, clientY: box.top + box.height / 2, bubbles: true};
      picture.dispatchEvent(new PointerEvent('pointermove', at));
      picture.dispatchEvent(new MouseEvent('click', at));
      return [document.getElementById('under').textContent, selection.frame]; })()""")
    check(re.search(r"right, .* up: (not seen|seen by \d+ stereo)", told), "the place under the pointer: " + told)
    check(0 <= chosen and browser.value("frames.camera[%d]" % chosen) == 0, "a stereo frame above it: %d" % chosen)
    check(browser.value("document.querySelectorAll('.grid-box .way').length") > 0, "the way over the ground")


def check_print(browser):
    """What is printed: images, and no table wider than the paper."""
    browser.call("Emulation.setEmulatedMedia", media="print")
    browser.call("Emulation.setDeviceMetricsOverride", width=688, height=1017, deviceScaleFactor=1, mobile=False)  # A4 less its margins
    hidden = browser.value("[...document.images].filter(one => one.getBoundingClientRect().width < 50).length")
    check(hidden == 0, "%d images are not printed" % hidden)
    wide = browser.value("[...document.querySelectorAll('section table')].filter(one => one.getBoundingClientRect().right > innerWidth).length")
    check(wide == 0, "%d tables are wider than the paper" % wide)


def look_at_report(browser, path, out, pictures):
    with open(path, encoding="utf-8") as file:
        html = file.read()
    check(len(html) <= 5_000_000, "at most 5 MB")
    data, summary = data_of(html), json_of(os.path.join(out, "summary.json"))
    browser.open("file://" + path)
    for section in SECTIONS:
        check(browser.value("document.querySelector('section#%s') !== null" % section), "section " + section)
    values = check_values(browser, summary)
    check(data["landmarks"]["count"] == summary["landmarks"], "all landmarks")
    check(data["keyframes"]["count"] == summary["keyframes"], "all keyframes")
    check(data["frames"]["count"] == summary["frames"]["read"] + summary["fisheye"]["frames"]["read"], "all frames")
    images = browser.value("[...document.images].filter(one => one.complete && one.naturalWidth > 0).length")
    check(images >= len(data["pictures"]) > 0, "%d pictures of %d" % (images, len(data["pictures"])))
    check(browser.value("document.querySelector('[data-figure=\"frames.dropped\"]').textContent") == str(summary["frames"]["dropped"]),
          "dropped")
    check_map(browser)
    check_coverage(browser)
    changed = browser.value("[...document.querySelectorAll('#run .wide tr')].map(one => one.innerText.split(/\\s+/).join(' '))")
    check("limit 8" in changed, "the limit among the options that differ: " + "; ".join(changed))
    charts = browser.value("[...document.querySelectorAll('#timeline h3')].map(one => one.textContent).join()")
    check("Rows of the pair" in charts, "rows in the timeline: " + charts)
    check(browser.value("document.querySelectorAll('#calibration svg[role=img]').length") >= 3, "noise floors by place")
    if pictures:
        browser.screenshot(os.path.join(pictures, "report.png"))
    browser.check_quiet("file://" + path)
    if isinstance(browser, Chromium):
        check_print(browser)
    return values


def look_at_many(kind, path, folder, pictures):
    check(os.path.getsize(path) <= 5_000_000, "100,000 landmarks in 5 MB")
    times, own = [], []
    for _ in range(2):
        browser = open_browser(kind, folder)
        try:
            before = cpu_seconds(browser.process.pid)
            browser.open("file://" + path)
            spent = cpu_seconds(browser.process.pid) - before
            times.append((spent, *(int(browser.value("document.documentElement.dataset." + name)) for name in ("ready", "drawn"))))
            check(browser.value("data.landmarks.count") == LANDMARKS, "all landmarks")
            if kind == "chromium":
                own.append(browser.page_seconds())
            if pictures:
                browser.screenshot(os.path.join(pictures, "large.png"))
            browser.check_quiet("file://" + path)
        finally:
            browser.close()
    spent, ready, drawn = (min(column) for column in zip(*times))
    print("100,000 landmarks: script %d ms, drawn after %d ms, %.2f s of CPU time in all processes" % (ready, drawn, spent))
    # CPU time, as the clock tells little on a busy machine; Firefox does not tell that of the page alone.
    if own:
        print("    %.2f s of CPU time in the page's own thread" % min(own))
        check(min(own) < 2, "the page's own work: %.2f s" % min(own))


def main():
    kind, program = sys.argv[1:3]
    pictures = sys.argv[3] if len(sys.argv) > 3 else ""
    program_of(kind)
    dataset = h1()
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "out")
        subprocess.run([program, dataset, "--sequence", "H1", "--limit", "8", "--out", out, "--quiet"],
                       check=True, stdout=subprocess.DEVNULL)
        path = os.path.join(out, "report.html")
        browser = open_browser(kind, folder)
        try:
            print("%d values of summary.json compared" % look_at_report(browser, path, out, pictures))
        finally:
            browser.close()
        large = os.path.join(folder, "large.html")
        with open(path, encoding="utf-8") as source, open(large, "w", encoding="utf-8") as file:
            file.write(with_many_landmarks(source.read()))
        look_at_many(kind, large, folder, pictures)


main()
