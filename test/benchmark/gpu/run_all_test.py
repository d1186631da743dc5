#!/usr/bin/env python3
"""Tests of run_all.py in a pack of stand-ins for the programs: what is run, skipped, kept, judged."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import unittest

HERE = pathlib.Path(__file__).resolve().parent

# Every stand-in appends its command line to calls.txt. The environment tells it what happens:
# DEVICE=1 there is a device; FAIL=WORD, HANG=WORD a command line with this word fails or hangs.
STAND_IN = '''#!{python} -IS
import json, os, sys, time
name, words = os.path.basename(sys.argv[0]), sys.argv[1:]


def write(text, *path):
    with open(os.path.join(*path), "w") as file:
        file.write(text)


with open({calls!r}, "a") as calls:
    calls.write(" ".join([name, *words]) + "\\n")
device = os.environ.get("DEVICE") == "1"
for word in words:
    if word == os.environ.get("FAIL"):
        sys.exit("it broke")
    if word == os.environ.get("HANG"):
        time.sleep(600)
option = lambda key: words[words.index(key) + 1]
if name == "hybrid_slam":
    if option("--device") == "cuda" and not device:
        print("hybrid_slam: error: --device cuda: no CUDA device: stand-in", file=sys.stderr)
        sys.exit(2)
    if words[0] == "no-such-data-set":
        sys.exit(3)
    out = option("--out")
    ate = float(os.environ.get("ATE", "0.001"))
    error = {{"registered": 5, "total": 5, "translation_m": {{"mean": 0.002}}, "rotation_deg": {{"mean": 0.1}}}}
    write(json.dumps({{
        "sift_engine": option("--device"), "keyframes": 3, "landmarks": 9, "seconds": 1.5,
        "frames": {{"read": 5, "tracked": 5, "lost": 0, "dropped": 0, "corrupt": 0}},
        "ate": {{"position_m": {{"rmse": ate}}}}, "fisheye": {{"relative_pose_error": error}}}}), out, "summary.json")
    row = {{"count": 5, "mean": 20.0, "p50": 20.0, "p95": 21.0, "max": 22.0, "p99": 22.0}}
    write(json.dumps(dict.fromkeys(["read", "sift", "stereo_match", "track"], row)), out, "timing.json")
elif name == "trajectory_eval":
    print(json.dumps({{"translation_m": {{"rmse": 0.0003}}}}))
elif name == "feature_eval":
    out = option("--out")
    os.makedirs(out, exist_ok=True)
    shift = float(os.environ.get("SHIFT", "0"))
    if words[0] == "extract":
        for image in words[1:words.index("--engine")]:
            rows = [f"{{10 * i + shift * i}},{{7.95 + i}},2,0.5,9" for i in range(4)]
            stem = os.path.splitext(os.path.basename(image))[0]
            write("\\n".join(["x,y,scale,angle,response", *rows]), out, stem + "_keypoints.csv")
    write(json.dumps({{"pairs": [{{"matches": 100}}]}}), option("--json"))
elif name == "sift_cuda_bench":
    rows = [{{"name": "made 1355x1002 N=4000", "found": 4000, "device_ms": 0.3, "total_ms": 0.5, "stages": {{}}}},
            {{"name": "match 4000x4000", "found": 9, "device_ms": 0.09, "total_ms": 0.1, "stages": {{}}}}]
    write(json.dumps(rows), option("--json"))
elif name == "cmake":
    if words[0] == "--build":
        target = os.path.join(words[1], "sift_cuda_test")
        write(open(sys.argv[0]).read(), target)
        os.chmod(target, 0o755)
elif name == "sift_cuda_test":
    print("all passed" if device else "no CUDA device: stand-in")
    sys.exit(0 if device else 77)
elif name in ("compute-sanitizer", "nvcc"):
    print("release 0, a stand-in")
'''

DEVICE_STEPS = ["bench", "contract", "memcheck", "racecheck"]


class RunAll(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.pack, cls.calls, tools = (cls.folder / name for name in ("pack", "calls.txt", "tools"))
        script = STAND_IN.format(python=sys.executable, calls=str(cls.calls))
        for place, names in ((cls.pack / "bin", ["hybrid_slam", "trajectory_eval", "feature_eval",
                                                 "sift_cuda_bench", "sift_cuda_test"]),
                             (tools, ["cmake", "nvcc", "compute-sanitizer"])):
            place.mkdir(parents=True)
            for name in names:
                (place / name).write_text(script)
                (place / name).chmod(0o755)
        (cls.pack / "pack.json").write_text('{"commit": "c0ffee", "date": "today"}')
        cls.environment = {**os.environ, "PATH": f"{tools}:{os.environ['PATH']}"}
        subprocess.run([sys.executable, HERE / "run_all.py", "--pack", cls.pack, "--out", cls.folder / "none",
                        "--make-reference"], check=True, stdout=subprocess.DEVNULL)

    def setUp(self):
        self.out = self.folder / self.id()
        self.calls.unlink(missing_ok=True)

    def run_all(self, *arguments, code=0, **environment):
        """Standard output of a run that must end with this code."""
        done = subprocess.run([sys.executable, HERE / "run_all.py", "--pack", self.pack, "--out", self.out,
                               *arguments], capture_output=True, text=True, timeout=300,
                              env={**self.environment, **environment})
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout

    def document(self):
        return json.loads((self.out / "gpu.json").read_text())

    def names(self, state):
        return [name for name, record in self.document()["steps"].items() if record["state"] == state]

    def programs_run(self, word):
        return [line for line in self.calls.read_text().splitlines() if word in line]

    def test_without_a_device_programs_run_by_the_cpu_and_the_rest_is_skipped_by_name(self):
        output = self.run_all()
        self.assertEqual(self.names("skipped"), DEVICE_STEPS)
        self.assertIn("skipped: " + " ".join(DEVICE_STEPS), output)
        self.assertEqual(self.names("failed") + self.names("left"), [])
        self.assertEqual(len(self.names("done")), 11)
        steps = self.document()["steps"]
        self.assertEqual(steps["bench"]["reason"], "no CUDA device: stand-in")
        self.assertEqual(steps["hybrid_4k"]["results"]["engine"], "cpu")
        self.assertAlmostEqual(steps["hybrid_4k"]["results"]["tracking_ms"], 60)
        judged = [v["what"] for v in self.document()["verdicts"]]
        self.assertIn("stereo_2k: ATE, mm", judged)
        self.assertNotIn("stereo_2k: tracking ms per frame", judged)
        self.assertIn("| stereo_2k | cpu | 5/5 |", (self.out / "gpu.md").read_text())
        self.assertEqual(sorted(path.name for path in self.out.iterdir()), ["gpu.json", "gpu.log", "gpu.md"])

    def test_with_a_device_its_times_are_judged(self):
        self.run_all(DEVICE="1")
        self.assertEqual(len(self.names("done")), 15)
        met = {v["what"]: v["met"] for v in self.document()["verdicts"]}
        self.assertTrue(met["made 1355x1002 N=4000: device ms"])
        self.assertFalse(met["match 4000x4000: device ms"])
        self.assertFalse(met["stereo_2k: tracking ms per frame"])
        self.assertTrue(met["stereo_4k: tracking ms per frame"])
        self.assertEqual(len(self.programs_run("compute-sanitizer --tool")), 2)

    def test_a_failure_keeps_the_others_and_resume_runs_only_what_is_not_done(self):
        self.run_all("--only", "stereo_2k", "--only", "hybrid_6k", "--only", "bench", code=1, FAIL="6000")
        self.assertEqual(self.names("done"), ["stereo_2k"])
        self.assertEqual(self.names("failed"), ["hybrid_6k"])
        self.assertEqual(self.document()["steps"]["hybrid_6k"]["reason"], "exit code 1: it broke")
        kept = self.document()["steps"]["stereo_2k"]
        self.calls.unlink()
        self.run_all("--resume", "--only", "stereo_2k", "--only", "hybrid_6k", "--only", "bench", DEVICE="1")
        self.assertEqual(self.document()["steps"]["stereo_2k"], kept)
        self.assertEqual(self.names("done"), ["bench", "stereo_2k", "hybrid_6k"])
        self.assertEqual(len(self.programs_run("--features 2000")), 0)
        self.assertEqual(len(self.programs_run("--features 6000")), 1)
        other = self.folder / "elsewhere.json"
        other.write_text((self.out / "gpu.json").read_text())
        self.calls.unlink()
        self.run_all("--resume", str(other), "--only", "bench", DEVICE="1")
        self.assertEqual(len(self.programs_run("sift_cuda_bench")), 0)

    def test_a_step_that_hangs_is_ended_at_its_limit_and_what_has_no_time_left_is_left(self):
        start = time.monotonic()
        self.run_all("--only", "stereo_4k", "--only", "stereo_2k", "--budget", "0.04", code=1, HANG="4000")
        self.assertLess(time.monotonic() - start, 200)  # of 600
        self.assertEqual(self.document()["steps"]["stereo_4k"]["reason"], "not done within its limit")
        self.assertEqual(self.names("left"), ["stereo_2k"])

    def test_results_that_differ_from_the_cpu_s_are_told(self):
        self.run_all("--only", "stereo_2k", "--only", "agreement", ATE="0.002", SHIFT="0.06")
        met = {v["what"]: v["met"] for v in self.document()["verdicts"]}
        self.assertFalse(met["stereo_2k: ATE, mm"])
        images = self.document()["steps"]["agreement"]["results"]["images"]
        self.assertEqual(len(images), 10)
        self.assertEqual({image["found"] for image in images}, {0.5})  # moved by 0, 0.06, 0.12, 0.18 px

    def test_bad_usage(self):
        self.run_all("--only", "no_such_step", code=2)
        self.run_all("--resume", code=1)


if __name__ == "__main__":
    unittest.main()
