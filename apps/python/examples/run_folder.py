"""Tracks a dataset and saves its map and path: run_folder.py DATASET OUT [SEQUENCE]"""

import sys
from pathlib import Path

import hybrid_slam


def show(results: list[hybrid_slam.FrameResult]) -> None:
    for result in results:
        causes = ", ".join(str(cause) for cause in result.causes)
        print(f"{result.time / 1e9:.3f} {result.camera} {result.state} {causes}")


dataset, out = sys.argv[1], Path(sys.argv[2])
name = sys.argv[3] if len(sys.argv) > 3 else ""
out.mkdir(parents=True, exist_ok=True)
sequence = hybrid_slam.open_sequence(dataset, sequence=name)
session = hybrid_slam.Session(sequence.rig, mode="every-frame")
for frame in sequence:
    session.push_stereo(frame.time, frame.left, frame.right)
    if frame.fisheye is not None:
        session.push_fisheye(frame.time, frame.fisheye)
    show(session.results())
session.finish()
show(session.results())
session.trajectory().write_tum(str(out / "stereo.tum"))
if sequence.rig.fisheye is not None:
    session.trajectory("fisheye").write_tum(str(out / "fisheye.tum"))
session.save(str(out / "map.hslam"))
