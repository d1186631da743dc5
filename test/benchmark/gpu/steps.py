"""The steps of run_all.py: what each one runs and what it reads from the results. All paths are
below the pack's folder. A step returns a dictionary of results, or raises Failed or Skipped."""

import csv
import json
import os
import pathlib
import shutil
import signal
import subprocess
import time

# Images that the engines are compared on, left and right ones of a moment beside each other.
H1 = "data/uwsynth/hybrid/H1"
KITTI = "data/kitti/sequences/s1"
PAIRS = [(f"{H1}/images/raw/{i}_left.jpg", f"{H1}/images/raw/{i}_right.jpg") for i in (0, 10, 20)]
PAIRS.append((f"{KITTI}/image_0/000000.png", f"{KITTI}/image_1/000000.png"))
FISHEYE = [f"{H1}/images/raw/{i}_fish.jpg" for i in (0, 10)]
AGREEMENT_FEATURES = 4000


class Failed(Exception):
    def __init__(self, reason, output=""):
        super().__init__(reason)
        self.output = output


class Skipped(Exception):
    pass


class Context:
    """Where the pack is, what the machine has, and how long the step may still take."""

    def __init__(self, pack, work, log, why_no_device):
        self.pack, self.work, self.log = pathlib.Path(pack), pathlib.Path(work), log
        self.why_no_device = why_no_device  # empty: there is one
        self.deadline = None
        self.reference = False  # the CPU's results are made, to be compared with later

    @property
    def engine(self):
        return "cpu" if self.why_no_device else "cuda"

    def call(self, command, codes=(0,), cwd=None):
        """Standard output of a command that ends with one of these codes before the deadline."""
        command = [str(word) for word in command]
        self.log.write(f"$ {' '.join(command)}\n")
        self.log.flush()
        left = None if self.deadline is None else max(self.deadline - time.monotonic(), 0.1)
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                   cwd=cwd or self.pack, start_new_session=True, errors="replace")
        try:
            output, _ = process.communicate(timeout=left)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            output, _ = process.communicate()
            self.log.write(output)
            raise Failed("not done within its limit")
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
        self.log.write(output)
        if process.returncode not in codes:
            lines = output.strip().splitlines() or [""]
            raise Failed(f"exit code {process.returncode}: {lines[-1][:200]}", output)
        return output

    def folder(self, name):
        """An empty one below work."""
        folder = self.work / name
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        return folder

    def program(self, name):
        return self.pack / "bin" / name


def why_no_device(context):
    """Empty if the program can use a CUDA device. A data set that does not exist is looked for only
    after the device."""
    command = [context.program("hybrid_slam"), "no-such-data-set", "--device", "cuda", "--quiet",
               "--out", context.work / "none"]
    output = context.call(command, codes=(2, 3))
    mark = "--device cuda: "
    return output.split(mark)[1].strip().splitlines()[0] if mark in output else ""


def first_line(context, command):
    try:
        return context.call(command).strip().splitlines()[0]
    except (Failed, OSError, IndexError):
        return ""


def machine(context):
    """Processor, device, driver, compilers."""
    with open("/proc/cpuinfo") as file:
        model = next((line.split(":")[1].strip() for line in file if line.startswith("model name")), "")
    found = {"cpu": model, "cores": len(os.sched_getaffinity(0)),
             "kernel": os.uname().release, "load": os.getloadavg()[0]}
    nvcc = shutil.which("nvcc") or "/usr/local/cuda/bin/nvcc"
    if os.path.exists(nvcc):
        version = context.call([nvcc, "--version"]).strip().splitlines()
        found["nvcc"] = next((line for line in version if "release" in line), version[-1])
    if context.why_no_device:
        found["why_no_device"] = context.why_no_device
        return found
    fields = ["name", "driver_version", "compute_cap", "memory.total", "clocks.max.sm",
              "clocks.max.mem", "clocks.sm", "clocks.mem", "temperature.gpu", "power.limit"]
    values = first_line(context, ["nvidia-smi", f"--query-gpu={','.join(fields)}",
                                  "--format=csv,noheader,nounits"])
    found.update(zip((f"gpu_{field}" for field in fields), (v.strip() for v in values.split(","))))
    return found


class Clocks:
    """The device's clocks while something runs, if nvidia-smi tells them."""

    def __enter__(self):
        self.values, self.process = [], None
        if shutil.which("nvidia-smi"):
            self.process = subprocess.Popen(
                ["nvidia-smi", "--query-gpu=clocks.sm,clocks.mem", "--format=csv,noheader,nounits",
                 "-lms", "200"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        return self

    def __exit__(self, *_):
        if self.process is None:
            return
        self.process.terminate()
        for line in self.process.communicate()[0].splitlines():
            words = line.split(",")
            if len(words) == 2 and all(word.strip().isdigit() for word in words):
                self.values.append(tuple(int(word) for word in words))

    def summary(self):
        if not self.values:
            return {}
        median = lambda i: sorted(v[i] for v in self.values)[len(self.values) // 2]
        return {"sm_mhz_median": median(0), "sm_mhz_max": max(v[0] for v in self.values),
                "mem_mhz_median": median(1)}


def bench(context):
    target = context.folder("bench") / "bench.json"
    with Clocks() as clocks:
        context.call([context.program("sift_cuda_bench"), "--json", target])
    return {"rows": json.loads(target.read_text()), "clocks": clocks.summary()}


def contract(context):
    output = context.call([context.program("sift_cuda_test")])
    return {"last_line": output.strip().splitlines()[-1]}


def sanitizer(tool):
    def step(context):
        program = shutil.which("compute-sanitizer") or "/usr/local/cuda/bin/compute-sanitizer"
        if not os.path.exists(program):
            raise Skipped("no compute-sanitizer on this machine")
        try:
            output = context.call([program, "--tool", tool, "--error-exitcode", "1",
                                   context.program("sift_cuda_test"), "--quick"])
        except Failed as failure:
            if "Device not supported" in failure.output:
                raise Skipped("compute-sanitizer does not support this machine's device")
            raise
        return {"last_line": output.strip().splitlines()[-1]}
    return step


def build(context):
    """The sources that are packed, built as on a machine that has only nvcc and CMake."""
    if not (shutil.which("nvcc") or os.path.exists("/usr/local/cuda/bin/nvcc")):
        raise Skipped("no nvcc on this machine")
    if not shutil.which("cmake"):
        raise Skipped("no cmake on this machine")
    folder = context.folder("build")
    configure = ["cmake", "-S", "source/frontend/features/cuda", "-B", folder,
                 "-D", "CMAKE_CUDA_ARCHITECTURES=90"]
    if not shutil.which("nvcc"):
        configure += ["-D", "CMAKE_CUDA_COMPILER=/usr/local/cuda/bin/nvcc"]
    context.call(configure + (["-G", "Ninja"] if shutil.which("ninja") else []))
    context.call(["cmake", "--build", folder, "-j", len(os.sched_getaffinity(0))])
    output = context.call([folder / "sift_cuda_test", "--quick"], codes=(77,) if context.why_no_device else (0,))
    return {"last_line": output.strip().splitlines()[-1]}


def read_keypoints(path):
    with open(path, newline="") as file:
        return [tuple(float(row[k]) for k in ("x", "y", "scale", "angle"))
                for row in csv.DictReader(file)]


def share_found(ours, theirs):
    """Share of the first that the second has within 0.1 px and 2 % of scale."""
    cells = {}
    for point in theirs:
        cells.setdefault((int(point[0]), int(point[1])), []).append(point)

    def found(point):
        x, y, scale, _ = point
        near = (p for dx in (-1, 0, 1) for dy in (-1, 0, 1)
                for p in cells.get((int(x) + dx, int(y) + dy), ()))
        return any((p[0] - x) ** 2 + (p[1] - y) ** 2 <= 0.01 and abs(p[2] / scale - 1) <= 0.02
                   for p in near)
    return sum(map(found, ours)) / len(ours) if ours else 1.0


def agreement(context):
    """Features of ten images, and matches of four stereo pairs, against the CPU's that are packed."""
    kept = context.pack / "reference/agreement"
    folder = kept if context.reference else context.folder("agreement")
    options = ["--engine", context.engine, "--upsample", "on", "--features", AGREEMENT_FEATURES]
    groups = [("left", [left for left, _ in PAIRS] + FISHEYE[:1]),
              ("right", [right for _, right in PAIRS] + FISHEYE[1:])]
    images, counts = [], []
    for name, members in groups:
        context.call([context.program("feature_eval"), "extract", *members, *options, "--out", folder / name,
                      "--json", context.work / f"{name}.json"])
        for image in members:
            stem = pathlib.Path(image).stem
            ours = read_keypoints(folder / name / f"{stem}_keypoints.csv")
            theirs = read_keypoints(kept / name / f"{stem}_keypoints.csv")
            images.append({"image": image, "features": len(ours), "features_cpu": len(theirs),
                           "found": share_found(ours, theirs), "found_back": share_found(theirs, ours)})
    for number, (left, right) in enumerate(PAIRS):
        target = context.work / f"pair{number}.json"
        context.call([context.program("feature_eval"), "match", left, right, *options,
                      "--out", context.work / f"pair{number}", "--json", target])
        counts.append(json.loads(target.read_text())["pairs"][0]["matches"])
    if context.reference:
        for picture in kept.rglob("*.png"):
            picture.unlink()
    return {"images": images, "matches": counts}


def slam(sequence, cameras, features, *options):
    """One run of hybrid_slam."""
    data = "data/kitti" if sequence == "s1" else "data/uwsynth"

    def step(context):
        folder = context.folder(f"{sequence}_{cameras}_{features}{len(options)}")
        context.call([context.program("hybrid_slam"), data, "--sequence", sequence, "--cameras", cameras,
                      "--features", features, "--device", context.engine, "--quiet", "--out", folder,
                      *options])
        summary = json.loads((folder / "summary.json").read_text())
        timing = json.loads((folder / "timing.json").read_text())
        results = {"engine": summary["sift_engine"], "frames": summary["frames"],
                   "keyframes": summary["keyframes"], "landmarks": summary["landmarks"],
                   "seconds": summary["seconds"], "ate_m": summary["ate"]["position_m"]["rmse"],
                   "stages_ms": {stage: {k: row[k] for k in ("count", "mean", "p50", "p95", "max")}
                                 for stage, row in timing.items()}}
        truth = f"{H1}/gt_left_tum.txt" if sequence == "H1" else "data/kitti/poses/s1.txt"
        times = [] if sequence == "H1" else ["--times", f"{KITTI}/times.txt"]
        rpe = context.call([context.program("trajectory_eval"), "rpe", folder / "stereo.tum", truth, "--json",
                            *times])
        results["rpe_m"] = json.loads(rpe)["translation_m"]["rmse"]
        if cameras == "hybrid":
            error = summary["fisheye"]["relative_pose_error"]
            results["fisheye"] = {"registered": error["registered"], "total": error["total"],
                                  "translation_m": error["translation_m"]["mean"],
                                  "rotation_deg": error["rotation_deg"]["mean"]}
        results["tracking_ms"] = tracking_ms(timing)
        return results
    return step


# What stands between a frame's images in memory and its pose, where nothing is done ahead.
TRACKING_STAGES = ("sift", "stereo_match", "track", "fisheye_sift", "track_fisheye")


def tracking_ms(timing):
    return sum(timing[stage]["mean"] for stage in TRACKING_STAGES if stage in timing)
