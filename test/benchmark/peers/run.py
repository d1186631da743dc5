#!/usr/bin/env python3
"""Runs ours and the peers on the same files in one go and writes the tables of docs/benchmarks.md.

    cmake --preset benchmark && cmake --build --preset benchmark --target benchmarks map_optimizer
    test/benchmark/peers/run.py [--data DIR] [--only WORD] [--repeat N]

--data: the folder with graphs/ (default: HYBRID_SLAM_DATA). --only: cases whose name holds WORD;
prints the table and leaves the file. --repeat: of each run, the fastest counts (default 3).
"""

import argparse
import json
import os
import pathlib
import platform
import subprocess
import sys
import tempfile

import install

HERE = pathlib.Path(__file__).resolve().parent
REPOSITORY = HERE.parents[2]
PROGRAMS = REPOSITORY / "build/benchmark/bin"
DOCUMENT = REPOSITORY / "docs/benchmarks.md"
BEGIN, END = "<!-- peers: begin -->", "<!-- peers: end -->"
STEREO_FACTORS = "stereo_factors.txt"


class Failed(Exception):
    pass


def call(command, timeout=600):
    try:
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True,
                              timeout=timeout, cwd=HERE)
    except subprocess.TimeoutExpired:
        raise Failed(f"not done after {timeout} s")
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        raise Failed(lines[-1][:100])
    return done.stdout


def last_json(text):
    return json.loads([line for line in text.splitlines() if line.startswith("{")][-1])


class Ours:
    name = "hybrid_slam"

    def __init__(self, *arguments):
        self.arguments = arguments

    def run(self, source, folder):
        call([PROGRAMS / "map_optimizer", source, "--quiet", "--out", folder, *self.arguments])
        report = json.loads((folder / "report.json").read_text())
        phases = ("build", "solve")
        result = next(p for p in folder.glob("optimized*") if p.suffix != ".tum")
        if result.is_dir():
            result = next(result.glob("*stereo_factors*"))
        return {"cpu_s": sum(report["cpu_seconds"][p] for p in phases),
                "wall_s": sum(report["seconds"][p] for p in phases),
                "peak_memory_mb": report["peak_memory_mb"], "iterations": report["iterations"],
                "cost": report["final_cost"], "blas": report["blas"], "commit": report["git_commit"],
                "result": None if source.suffix == ".seq" else result}


class OursIncremental:
    name = "hybrid_slam incremental"

    def run(self, source, folder):
        call([PROGRAMS / "map_optimizer", source, "--problem", "incremental", "--quiet", "--out", folder])
        report = json.loads((folder / "report.json").read_text())
        header, *rows = (folder / "updates.csv").read_text().splitlines()
        columns = header.split(",")
        column = lambda name: [float(row.split(",")[columns.index(name)]) for row in rows]
        cpu, wall = column("cpu_ms"), column("wall_ms")
        return {"mean_cpu_ms": sum(cpu) / len(cpu), "max_cpu_ms": max(cpu), "max_wall_ms": max(wall),
                "peak_memory_mb": report["peak_memory_mb"], "cost": report["final_cost"],
                "result": None if source.suffix == ".seq" else folder / f"optimized{source.suffix}"}


class Peer:
    """A Python script beside this one, in one of the environments."""

    def __init__(self, name, environment, script, kind):
        self.name, self.environment, self.script, self.kind = name, environment, script, kind

    def run(self, source, folder):
        stereo = self.kind.startswith("stereo")
        target = folder if stereo else folder / f"result{source.suffix}"
        python = install.python(self.environment)
        report = last_json(call([python, HERE / self.script, self.kind, source, target]))
        return {**report, "result": folder / STEREO_FACTORS if stereo else target}


class OursMixed:
    name = "hybrid_slam incremental"

    def run(self, source, folder):
        return {**last_json(call([PROGRAMS / "mixed_stream_benchmark", "run"])), "result": None}


class PeerMixed:
    """ISAM2 on the mixed stream; our factors say what its estimate costs."""
    name = "gtsam 4.3.0, ISAM2"

    def run(self, source, folder):
        target = folder / "result.txt"
        python = install.python("newest")
        run = last_json(call([python, HERE / "gtsam_mixed.py", "mixed", source, target], 1200))
        score = last_json(call([PROGRAMS / "mixed_stream_benchmark", "score", target]))
        return {**run, **score, "result": None}


class CeresExample:
    def __init__(self, solver):
        self.name, self.solver = f"Ceres example, {solver} Schur", solver

    def run(self, source, folder):
        target = folder / "result.txt"
        return {**last_json(call([PROGRAMS / "ceres_bundle", self.solver, source, target])),
                "result": target}


def sigma_of(source):
    """Of the measurements; results of streams are written and scored with 1 px."""
    if source.suffix != ".seq":
        return 1.0
    words = source.open().readline().split()
    return float(words[words.index("SIGMA_PX") + 1])


def best_run(solver, source, repeat, key):
    best = None
    for _ in range(repeat):
        with tempfile.TemporaryDirectory() as folder:
            run = solver.run(source, pathlib.Path(folder))
            if run["result"] is not None:
                run.update(last_json(call([PROGRAMS / "graph_score", run["result"]])))
                run["cost"] /= sigma_of(source) ** 2
                run["chi2"] /= sigma_of(source) ** 2
        if best is None or run[key] < best[key]:
            best = run
    return best


def pose_graph_case(name):
    return f"g2o/{name}.g2o", [
        Ours(),
        Peer("gtsam 4.3.0, chordal + GN", "newest", "gtsam_batch.py", "pose-graph-chordal"),
        Peer("gtsam 4.3.0, given + GN", "newest", "gtsam_batch.py", "pose-graph-given"),
        Peer("gtsam 4.2, chordal + GN", "gtsam42", "gtsam_batch.py", "pose-graph-chordal")]


def bundle_case(name):
    return f"bal/{name}.txt", [
        Ours("--iterations", "60"), CeresExample("dense"), CeresExample("sparse"),
        Peer("pycolmap 4.2.1", "newest", "pycolmap_bundle.py", "bal"),
        Peer("gtsam 4.2, LM", "gtsam42", "gtsam_batch.py", "bal"),
        Peer("gtsam 4.3.0, LM", "newest", "gtsam_batch.py", "bal")]


def stereo_case(path, kind):
    return path, [Ours(), Peer("gtsam 4.3.0, LM", "newest", "gtsam_batch.py", kind),
                  Peer("gtsam 4.2, LM", "gtsam42", "gtsam_batch.py", kind)]


def incremental_case(path, kind):
    return path, [OursIncremental(),
                  Peer("gtsam 4.3.0, ISAM2", "newest", "gtsam_isam2.py", kind),
                  Peer("gtsam 4.2, ISAM2", "gtsam42", "gtsam_isam2.py", kind)]


BATCH = [*map(pose_graph_case, ["sphere2500", "torus3D", "parking-garage", "smallGrid3D",
                               "cubicle"]),
         *map(bundle_case, ["trafalgar-21-11315-pre", "survey-150-pre", "problem-49-7776-pre"]),
         stereo_case("gtsam/VO_stereo_factors_large.txt", "stereo-graph"),
         stereo_case("stereo_seq/survey-150-stereo.seq", "stereo-stream")]
INCREMENTAL = [incremental_case("g2o/sphere2500.g2o", "pose-graph"),
               incremental_case("g2o/parking-garage.g2o", "pose-graph"),
               incremental_case("stereo_seq/survey-150-stereo.seq", "stereo-stream")]


def made_cases(folder):
    """Of inputs that our programs write: a survey as long as GTSAM holds it, and a mixed graph."""
    survey, mixed = folder / "lawn-mower-300.seq", folder / "mixed-2000.txt"
    call([PROGRAMS / "lawn_mower_benchmark", "300", "write", survey])
    call([PROGRAMS / "mixed_stream_benchmark", "write", mixed])
    newest = Peer("gtsam 4.3.0, ISAM2", "newest", "gtsam_isam2.py", "stereo-stream")
    return [(str(survey), [OursIncremental(), newest]), (str(mixed), [OursMixed(), PeerMixed()])]


def table(cases, data, only, repeat, key, columns):
    rows = [f"| input | program | {' | '.join(title for title, _ in columns)} | ours / this |",
            "|" + "---|" * (len(columns) + 3)]
    ours_seen = None
    for path, solvers in cases:
        if only not in path:
            continue
        ours = None
        for solver in solvers:
            print(f"{path}: {solver.name}", file=sys.stderr)
            label = pathlib.Path(path).stem if solver is solvers[0] else ""
            try:
                run = best_run(solver, data / path, repeat, key)
            except Failed as reason:
                rows.append(f"| {label} | {solver.name} | not run: {reason} |")
                continue
            if solver is solvers[0]:
                ours = ours_seen = run
            cells = [show(run) for _, show in columns]
            ratio = f"{ours[key] / run[key]:.2f}" if ours and run is not ours else ""
            rows.append(f"| {label} | {solver.name} | {' | '.join(cells)} | {ratio} |")
    return rows, ours_seen


def show(key, digits, scale=1.0):
    return lambda run: f"{run[key] * scale:.{digits}f}" if key in run else ""


def se_sync(run):
    return f"{run['se_sync']:.4f}" if run.get("se_sync") else ""


def significant(key):
    return lambda run: f"{run[key]:.9g}"


def machine():
    model = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo")
                  if line.startswith("model name")), platform.machine())
    return f"{model}, {os.cpu_count()} cores; load {os.getloadavg()[0]:.1f} at the start"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=pathlib.Path, default=os.environ.get("HYBRID_SLAM_DATA"))
    parser.add_argument("--only", default="")
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    if options.data is None:
        parser.error("where are the data? --data or HYBRID_SLAM_DATA")
    where = machine()
    arguments = (pathlib.Path(options.data) / "graphs", options.only, options.repeat)
    batch, ours = table(BATCH, *arguments, "cpu_s", [
        ("cost", significant("cost")), ("SE-Sync F", se_sync),
        ("iterations", show("iterations", 0)), ("CPU s", show("cpu_s", 3)),
        ("wall s", show("wall_s", 3)), ("peak MB", show("peak_memory_mb", 0))])
    with tempfile.TemporaryDirectory() as folder:
        cases = INCREMENTAL + made_cases(pathlib.Path(folder))
        incremental, _ = table(cases, *arguments, "mean_cpu_ms", [
            ("cost", significant("cost")), ("mean CPU ms", show("mean_cpu_ms", 2)),
            ("max CPU ms", show("max_cpu_ms", 1)), ("max wall ms", show("max_wall_ms", 1)),
            ("peak MB", show("peak_memory_mb", 0))])
    wheels = ", ".join(w for wanted in install.ENVIRONMENTS.values() for w in wanted)
    about = f"Machine: {where}. Wheels: {wheels}."
    if ours:
        about += f" Ours: commit {ours['commit']}, BLAS {ours['blas']}."
    text = "\n".join([about, "", "### Batch", "", *batch, "", "### Incremental", "", *incremental])
    if options.only:
        print(text)
        return
    document = DOCUMENT.read_text()
    before, rest = document.split(BEGIN)
    DOCUMENT.write_text(before + BEGIN + "\n" + text + "\n" + END + rest.split(END)[1])


if __name__ == "__main__":
    main()
