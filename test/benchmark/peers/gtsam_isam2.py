"""ISAM2 fed update by update: `gtsam_isam2.py KIND INPUT OUTPUT`; KIND as in gtsam_batch.py.

Relinearisation threshold 0.1, every 10 updates. One update is a pose and all factors that it closes;
what is measured is iSAM's update and the estimate of the newest pose.
"""

import pathlib
import sys
import time

import gtsam
import numpy as np

import formats
from measure import Stopwatch, report

L, X = gtsam.symbol_shorthand.L, gtsam.symbol_shorthand.X


def new_isam2(factorization):
    parameters = gtsam.ISAM2Params()
    parameters.setRelinearizeThreshold(0.1)
    parameters.relinearizeSkip = 10
    parameters.setFactorization(factorization)
    return gtsam.ISAM2(parameters)


class Updates:
    """CPU milliseconds of each update of an ISAM2."""

    def __init__(self, factorization="CHOLESKY"):
        self.isam = new_isam2(factorization)
        self.cpu_ms, self.wall_ms = [], []
        self.whole = Stopwatch()

    def add(self, graph, values, newest, groups=None):
        """groups: the order of elimination where it is constrained, a gtsam.KeyGroupMap."""
        order = {} if groups is None else {"constrainedKeys": groups}
        cpu, wall = time.process_time(), time.perf_counter()
        self.isam.update(graph, values, **order)
        pose = self.isam.calculateEstimatePose3(newest)
        self.cpu_ms.append(1e3 * (time.process_time() - cpu))
        self.wall_ms.append(1e3 * (time.perf_counter() - wall))
        return pose

    def report(self):
        report(peer="isam2", updates=len(self.cpu_ms), mean_cpu_ms=float(np.mean(self.cpu_ms)),
               max_cpu_ms=float(np.max(self.cpu_ms)), max_wall_ms=float(np.max(self.wall_ms)),
               **self.whole.read())


def pose_graph(source, target):
    """An edge is added with the later of its two vertices, whose odometry or first edge places it."""
    graph, values = gtsam.readG2o(source, True)
    ids = sorted(formats.keys_of(values))
    edges = {i: [] for i in ids}
    for k in range(graph.size()):
        factor = graph.at(k)
        edges[max(formats.keys_of(factor))].append(factor)
    updates = Updates()
    for i in ids:
        new_factors, new_values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        for factor in edges[i]:
            new_factors.add(factor)
        if i == ids[0]:
            pose = values.atPose3(i)
            noise = gtsam.noiseModel.Diagonal.Variances(np.array([1e-8] * 6))
            new_factors.add(gtsam.PriorFactorPose3(i, pose, noise))
        else:
            pose = placed_by(edges[i], i, updates.isam)
        new_values.insert(i, pose)
        updates.add(new_factors, new_values, i)
    result = updates.isam.calculateEstimate()
    formats.write_g2o(source, target, {i: result.atPose3(i) for i in ids})
    updates.report()


def placed_by(factors, vertex, isam):
    """By the edge from the nearest earlier vertex."""
    edge = max(factors, key=lambda factor: min(formats.keys_of(factor)))
    a, b = formats.keys_of(edge)
    if b == vertex:
        return isam.calculateEstimatePose3(a).compose(edge.measured())
    return isam.calculateEstimatePose3(b).compose(edge.measured().inverse())


def stereo_stream(source, target):
    """Poses start at the previous estimate moved by the odometry, landmarks where the first
    observation puts them from there. The first pose is fixed at its truth."""
    problem = formats.read_stereo_stream(pathlib.Path(source))
    f, cx, cy, baseline = problem.camera
    calibration = gtsam.Cal3_S2Stereo(f[0], f[1], 0, cx, cy, baseline)
    noise = gtsam.noiseModel.Isotropic.Sigma(3, problem.sigma)
    by_pose = [[] for _ in problem.poses]
    for pose, *rest in problem.observations:
        by_pose[pose].append(rest)
    known, updates, last = set(), Updates(), None
    for i, observations in enumerate(by_pose):
        new_factors, new_values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        if i == 0:
            pose = gtsam.Pose3(problem.truth[0])
            new_factors.add(gtsam.NonlinearEqualityPose3(X(0), pose))
        else:
            pose = last.compose(gtsam.Pose3(problem.odometry[i]))
        new_values.insert(X(i), pose)
        for point, left, right, v in observations:
            new_factors.add(gtsam.GenericStereoFactor3D(gtsam.StereoPoint2(left, right, v), noise, X(i),
                                                        L(point), calibration))
            if point not in known:
                known.add(point)
                in_cam = formats.triangulate(problem.camera, left, right, v)
                new_values.insert(L(point), pose.transformFrom(in_cam))
        last = updates.add(new_factors, new_values, X(i))
    result = updates.isam.calculateEstimate()
    problem.poses = [result.atPose3(X(i)).matrix() for i in range(len(problem.poses))]
    problem.points = [result.atPoint3(L(j)) for j in range(len(problem.points))]
    formats.write_stereo_graph(pathlib.Path(target), problem)
    updates.report()


if __name__ == "__main__":
    kind, *paths = sys.argv[1:]
    (stereo_stream if kind == "stereo-stream" else pose_graph)(*paths)
