"""ISAM2 on a mixed stream: `gtsam_mixed.py mixed INPUT OUTPUT`, of test/benchmark/mixed_stream.h.

Poses, ranges to beacons and one calibration, with GTSAM's own factors; the calibration is
constrained to come last, the newest pose before it. Factored by QR: its Cholesky calls the system
indeterminate after some steps. Else as gtsam_isam2.py.

    SIGMAS way turn range beacon calibration pixel
    CALIBRATION 0 fx fy cx cy         BEACON i x y z
    STEP i <pose>                     of the first: world_from_cam, else previous_from_current
    RANGE beacon metres
    POINT i x y z                     new, in the camera of this step
    SEEN step point u v
"""

import sys

import gtsam
import numpy as np

import formats
from gtsam_isam2 import Updates

B, L, X = (getattr(gtsam.symbol_shorthand, letter) for letter in "BLX")
K = gtsam.symbol("K", 0)
NO_SKEW = 1e-3  # ours has none


def diagonal(*sigmas):
    return gtsam.noiseModel.Diagonal.Sigmas(np.array(sigmas))


class Steps:
    """The stream, a step at a time: its factors, its new values and its number."""

    def __init__(self, lines):
        self.lines = iter(lines)
        way, turn, distance, beacon, calibration, pixel = self.numbers("SIGMAS")
        self.odometry = diagonal(*[turn] * 3, *[way] * 3)
        self.range, self.pixel = diagonal(distance), diagonal(pixel, pixel)
        self.beacon = diagonal(*[beacon] * 3)
        self.calibration = diagonal(calibration, calibration, NO_SKEW, calibration, calibration)
        self.beacons = {}

    def numbers(self, kind):
        words = next(self.lines).split()
        assert words[0] == kind
        return [float(word) for word in words[1:]]

    def begin(self, graph, values):
        _, fx, fy, cx, cy = self.numbers("CALIBRATION")
        start = gtsam.Cal3_S2(fx, fy, 0, cx, cy)
        values.insert(K, start)
        graph.add(gtsam.PriorFactorCal3_S2(K, start, self.calibration))

    def add(self, words, pose, graph, values, step):
        kind, index, *numbers = words[0], int(words[1]), *(float(word) for word in words[2:])
        if kind == "RANGE":
            if index in self.beacons:  # comes in with its first range
                place = self.beacons.pop(index)
                values.insert(B(index), place)
                graph.add(gtsam.PriorFactorPoint3(B(index), place, self.beacon))
            graph.add(gtsam.RangeFactor3D(X(step), B(index), numbers[0], self.range))
        elif kind == "POINT":
            values.insert(L(index), pose.transformFrom(np.array(numbers)))
        else:
            point, *pixel = numbers
            graph.add(gtsam.GeneralSFMFactor2Cal3_S2(np.array(pixel), self.pixel, X(index),
                                                     L(int(point)), K))


def steps_of(path):
    with open(path) as lines:
        rows = [line.split() for line in lines]
    starts = [i for i, row in enumerate(rows) if row[0] == "STEP"] + [len(rows)]
    head = [" ".join(row) for row in rows[:starts[0]] if row[0] != "BEACON"]
    beacons = {int(row[1]): np.array([float(x) for x in row[2:]])
               for row in rows[:starts[0]] if row[0] == "BEACON"}
    return head, beacons, [rows[a:b] for a, b in zip(starts, starts[1:])]


def last_of_all(step):
    groups = gtsam.KeyGroupMap()
    groups.insert2(X(step), 1)
    groups.insert2(K, 2)
    return groups


def write(target, estimate, steps, known):
    with open(target, "w") as out:
        def line(kind, index, values):
            out.write(" ".join([kind, str(index), *(f"{x:.17g}" for x in values)]) + "\n")
        for i in range(steps):
            pose = estimate.atPose3(X(i))
            line("POSE", i, [*pose.translation(), *formats.quaternion(pose.rotation().matrix())])
        for kind, i in known:
            name = "POINT" if kind == "POINT" else "BLOCK"
            line(name, i, estimate.atPoint3(L(i) if kind == "POINT" else B(i)))
        found = estimate.atCal3_S2(K)
        line("BLOCK", 0, [found.fx(), found.fy(), found.px(), found.py()])


def main(source, target):
    head, beacons, all_steps = steps_of(source)
    stream = Steps(head)
    stream.beacons = dict(beacons)
    updates, known, last = Updates("QR"), [], None
    for i, rows in enumerate(all_steps):
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        motion = gtsam.Pose3(formats.matrix_of([float(x) for x in rows[0][2:]]))
        if i == 0:
            stream.begin(graph, values)
            pose = motion
            graph.add(gtsam.NonlinearEqualityPose3(X(0), pose))
        else:
            pose = last.compose(motion)
            graph.add(gtsam.BetweenFactorPose3(X(i - 1), X(i), motion, stream.odometry))
        values.insert(X(i), pose)
        for words in rows[1:]:
            stream.add(words, pose, graph, values, i)
            if words[0] == "POINT":
                known.append(("POINT", int(words[1])))
        last = updates.add(graph, values, X(i), last_of_all(i))
    known += [("BEACON", i) for i in beacons if i not in stream.beacons]
    write(target, updates.isam.calculateEstimate(), len(all_steps), known)
    updates.report()


if __name__ == "__main__":
    main(*sys.argv[2:])
