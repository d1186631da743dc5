#!/usr/bin/env python3
"""The whole proof of the CUDA engine in one run, on a machine with a GPU and nothing installed.

    run_all.py [--out DIR] [--only STEP]... [--resume [GPU_JSON]] [--budget SECONDS] [--list]

Runs the steps in order of value, each with its own limit, and writes gpu.json, gpu.md (the table of
docs/benchmarks.md) and gpu.log to DIR after each one, so that nothing is lost with a later step.
--only: this step (may be given several times). --resume: keeps the steps that are done in DIR's
gpu.json, or the one given, and runs the others: those that failed, were skipped, or had no time left.
--budget: seconds in all (300); a step that would begin later is left for --resume. Without a device
the programs run by the CPU's engine, steps that need one are skipped, and limits and budget are thirty
times as long. Exit code 0: nothing failed and nothing is left; 1: some step did; 2: bad usage.
"""

import argparse
import datetime
import json
import os
import pathlib
import shutil
import sys
import tempfile
import time

sys.dont_write_bytecode = True  # beside the sources
import report
import steps

HERE = pathlib.Path(__file__).resolve().parent
SLOWER_WITHOUT_DEVICE = 30  # two busy cores were; limits there only end what hangs


class Step:
    def __init__(self, name, limit, run, device=False, reference=False):
        self.name, self.limit, self.run = name, limit, run
        self.device = device        # needs one
        self.reference = reference  # the CPU's results are packed, for comparison


ONE = ("--threads", 1)  # nothing is extracted beside what is timed
STEPS = [
    Step("machine", 20, steps.machine),
    Step("bench", 40, steps.bench, device=True),
    Step("agreement", 40, steps.agreement, reference=True),
    Step("stereo_4k", 30, steps.slam("H1", "stereo", 4000, *ONE), reference=True),
    Step("hybrid_4k", 40, steps.slam("H1", "hybrid", 4000, *ONE), reference=True),
    Step("stereo_2k", 30, steps.slam("H1", "stereo", 2000, *ONE), reference=True),
    Step("hybrid_2k", 30, steps.slam("H1", "hybrid", 2000, *ONE), reference=True),
    Step("kitti_2k", 30, steps.slam("s1", "stereo", 2000, *ONE), reference=True),
    Step("realtime_4k", 40, steps.slam("H1", "hybrid", 4000, "--mode", "realtime", "--rate", 3),
         reference=True),
    Step("contract", 60, steps.contract, device=True),
    Step("memcheck", 60, steps.sanitizer("memcheck"), device=True),
    Step("hybrid_6k", 60, steps.slam("H1", "hybrid", 6000, *ONE), reference=True),
    Step("stereo_6k", 40, steps.slam("H1", "stereo", 6000, *ONE), reference=True),
    Step("racecheck", 60, steps.sanitizer("racecheck"), device=True),
    Step("build", 100, steps.build),
]


def write_whole(path, text):
    part = path.with_suffix(".part")
    part.write_text(text)
    os.replace(part, path)


def read_references(pack):
    return {step.name: json.loads((pack / f"reference/{step.name}.json").read_text())
            for step in STEPS if (pack / f"reference/{step.name}.json").exists()}


def run_step(step, context, limit):
    """The record of one step; never raises."""
    start = time.monotonic()
    record = {"state": "done", "limit_s": limit}
    context.deadline = start + limit
    context.log.write(f"\n=== {step.name}\n")
    try:
        if step.device and context.why_no_device:
            raise steps.Skipped(context.why_no_device)
        record["results"] = step.run(context)
    except steps.Skipped as reason:
        record.update(state="skipped", reason=str(reason))
    except steps.Failed as reason:
        record.update(state="failed", reason=str(reason))
    except Exception as error:  # a result that is not as expected must not end the other steps
        record.update(state="failed", reason=f"{type(error).__name__}: {error}")
    record["seconds"] = round(time.monotonic() - start, 2)
    context.log.flush()
    return record


def parse():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("gpu-out"))
    parser.add_argument("--only", action="append", choices=[step.name for step in STEPS], metavar="STEP")
    parser.add_argument("--resume", nargs="?", const="", metavar="GPU_JSON")
    parser.add_argument("--budget", type=float, default=300)
    parser.add_argument("--list", action="store_true", help="names of the steps and their limits")
    parser.add_argument("--make-reference", action="store_true",
                        help="writes the CPU's results into the pack; pack.sh does it")
    parser.add_argument("--pack", type=pathlib.Path, default=HERE, help="the pack's folder (this one)")
    return parser.parse_args()


def earlier_records(options):
    """Of the steps that need not run again."""
    if options.resume is None:
        return {}
    path = pathlib.Path(options.resume) if options.resume else options.out / "gpu.json"
    try:
        records = json.loads(path.read_text())["steps"]
    except (OSError, ValueError, KeyError) as error:
        sys.exit(f"run_all.py: --resume: {path} is no gpu.json: {error}")
    return {name: record for name, record in records.items() if record["state"] == "done"}


def make_reference(context):
    context.reference = True
    folder = context.pack / "reference"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    context.why_no_device = "the CPU's results are made"
    for step in STEPS:
        if not step.reference:
            continue
        record = run_step(step, context, 3600)
        print(f"reference {step.name}: {record['state']}, {record['seconds']} s", flush=True)
        if record["state"] != "done":
            sys.exit(f"run_all.py: {step.name}: {record['reason']}")
        (folder / f"{step.name}.json").write_text(json.dumps(record["results"], indent=1))


def run_all(options, context, document):
    references = read_references(context.pack)
    slower = SLOWER_WITHOUT_DEVICE if context.why_no_device else 1
    start = time.monotonic()
    for step in STEPS:
        wanted = not options.only or step.name in options.only
        if not wanted or document["steps"].get(step.name, {}).get("state") == "done":
            continue
        left = options.budget * slower - (time.monotonic() - start)
        if left > 0:
            record = run_step(step, context, round(min(step.limit * slower, left), 1))
        else:
            record = {"state": "left", "reason": "no time left of the budget", "seconds": 0}
        records = {**document["steps"], step.name: record}
        document["steps"] = {s.name: records[s.name] for s in STEPS if s.name in records}
        document["seconds"] = round(sum(r["seconds"] for r in records.values()), 1)
        document["verdicts"] = report.verdicts(document["steps"], references)
        write_whole(options.out / "gpu.json", json.dumps(document, indent=1) + "\n")
        write_whole(options.out / "gpu.md", report.markdown(document, references))
        print(f"{step.name}: {record['state']}, {record['seconds']} s"
              + (f" ({record['reason']})" if "reason" in record else ""), flush=True)


def main():
    options = parse()
    if options.list:
        for step in STEPS:
            print(f"{step.name}: at most {step.limit} s" + (", needs a device" if step.device else ""))
        return 0
    options.out.mkdir(parents=True, exist_ok=True)
    document = {"date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
                "pack": json.loads((options.pack / "pack.json").read_text()),
                "steps": earlier_records(options)}
    with open(options.out / "gpu.log", "a") as log, tempfile.TemporaryDirectory() as work:
        context = steps.Context(options.pack.resolve(), work, log, "")
        if options.make_reference:
            make_reference(context)
            return 0
        try:
            context.why_no_device = document["why_no_device"] = steps.why_no_device(context)
        except (steps.Failed, OSError) as error:
            sys.exit(f"run_all.py: the packed programs do not run here (glibc older than the pack's?): {error}")
        print(context.why_no_device or "a CUDA device is there", flush=True)
        run_all(options, context, document)
    states = [record["state"] for record in document["steps"].values()]
    for state in ("done", "skipped", "failed", "left"):
        names = [name for name, record in document["steps"].items() if record["state"] == state]
        if names:
            print(f"{state}: {' '.join(names)}")
    print(f"steps: {document.get('seconds', 0)} s; {options.out}/gpu.json, gpu.md, gpu.log")
    return 1 if "failed" in states or "left" in states else 0


if __name__ == "__main__":
    sys.exit(main())
