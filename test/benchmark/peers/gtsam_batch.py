"""GTSAM on one file: `gtsam_batch.py KIND INPUT OUTPUT`. Writes its result in the input's format.

pose-graph-chordal, pose-graph-given   Gauss-Newton from that start; CPU time includes the start
bal                                    Levenberg-Marquardt, 9-parameter cameras (Cal3Bundler)
stereo-graph, stereo-stream            Levenberg-Marquardt, the first pose fixed
"""

import pathlib
import sys

import gtsam
import numpy as np

import formats
from measure import Stopwatch, report


def pose_graph(source, target, chordal):
    graph, values = gtsam.readG2o(source, True)
    first = min(formats.keys_of(values))
    noise = gtsam.noiseModel.Diagonal.Variances(np.array([1e-8] * 6))
    anchored = gtsam.NonlinearFactorGraph(graph)
    anchored.add(gtsam.PriorFactorPose3(first, values.atPose3(first), noise))
    watch = Stopwatch()
    if chordal:
        values = gtsam.InitializePose3.initialize(anchored)
    optimizer = gtsam.GaussNewtonOptimizer(anchored, values, gtsam.GaussNewtonParams())
    result = optimizer.optimize()
    times = watch.read()
    formats.write_g2o(source, target, {k: result.atPose3(k) for k in formats.keys_of(result)})
    return times, optimizer.iterations()


def levenberg_marquardt(graph, values):
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-5)
    parameters.setAbsoluteErrorTol(1e-5)
    optimizer = gtsam.LevenbergMarquardtOptimizer(graph, values, parameters)
    watch = Stopwatch()
    result = optimizer.optimize()
    return result, watch.read(), optimizer.iterations()


def bal(source, target):
    problem = formats.read_bal(source)
    graph = gtsam.NonlinearFactorGraph()
    noise = gtsam.noiseModel.Unit.Create(2)
    points = len(problem.cameras)
    for camera, point, u, v in problem.observations:
        graph.add(gtsam.GeneralSFMFactorCal3Bundler(np.array([u, -v]), noise, camera, points + point))
    values = gtsam.Values()
    flip = gtsam.Rot3(np.diag([1.0, -1.0, -1.0]))  # BAL looks along -z with y up
    for i, camera in enumerate(problem.cameras):
        rotation = gtsam.Rot3.Expmap(camera[:3]).inverse().compose(flip)
        cam_from_world = gtsam.Pose3(gtsam.Rot3.Expmap(camera[:3]), camera[3:6])
        pose = gtsam.Pose3(rotation, cam_from_world.inverse().translation())
        values.insert(i, gtsam.PinholeCameraCal3Bundler(
            pose, gtsam.Cal3Bundler(camera[6], camera[7], camera[8], 0, 0)))
    for j, point in enumerate(problem.points):
        values.insert(points + j, point)
    # No prior holds the gauge: the damping does, and a prior would cost something.
    result, times, iterations = levenberg_marquardt(graph, values)
    for i in range(points):
        camera = result.atPinholeCameraCal3Bundler(i)
        calibration = camera.calibration()
        rotation = flip.compose(camera.pose().rotation().inverse())
        translation = -rotation.matrix() @ camera.pose().translation()
        problem.cameras[i] = np.concatenate([
            gtsam.Rot3.Logmap(rotation), translation,
            [calibration.fx(), calibration.k1(), calibration.k2()]])
    for j in range(len(problem.points)):
        problem.points[j] = result.atPoint3(points + j)
    formats.write_bal(target, problem)
    return times, iterations


def stereo(problem, write):
    """The first pose is fixed; a landmark starts where the reader put it."""
    L, X = gtsam.symbol_shorthand.L, gtsam.symbol_shorthand.X
    f, cx, cy, baseline = problem.camera
    calibration = gtsam.Cal3_S2Stereo(f[0], f[1], 0, cx, cy, baseline)
    noise = gtsam.noiseModel.Isotropic.Sigma(3, problem.sigma)
    graph = gtsam.NonlinearFactorGraph()
    graph.add(gtsam.NonlinearEqualityPose3(X(0), gtsam.Pose3(problem.poses[0])))
    for pose, landmark, left, right, v in problem.observations:
        graph.add(gtsam.GenericStereoFactor3D(gtsam.StereoPoint2(left, right, v), noise, X(pose),
                                              L(landmark), calibration))
    values = gtsam.Values()
    for i, pose in enumerate(problem.poses):
        values.insert(X(i), gtsam.Pose3(pose))
    for j, point in enumerate(problem.points):
        values.insert(L(j), point)
    result, times, iterations = levenberg_marquardt(graph, values)
    for i in range(len(problem.poses)):
        problem.poses[i] = result.atPose3(X(i)).matrix()
    for j in range(len(problem.points)):
        problem.points[j] = result.atPoint3(L(j))
    write(problem)
    return times, iterations


def main(kind, source, target):
    if kind.startswith("pose-graph"):
        times, iterations = pose_graph(source, target, kind.endswith("chordal"))
    elif kind == "bal":
        times, iterations = bal(source, target)
    else:
        read = formats.read_stereo_graph if kind == "stereo-graph" else formats.read_stereo_stream
        problem = read(pathlib.Path(source))
        times, iterations = stereo(
            problem, lambda solved: formats.write_stereo_graph(pathlib.Path(target), solved))
    report(peer="gtsam", iterations=iterations, **times)


if __name__ == "__main__":
    main(*sys.argv[1:])
