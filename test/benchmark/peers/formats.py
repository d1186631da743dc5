"""Just enough of the graph formats for the peers: see apps/io/graphs for what they mean."""

import dataclasses
import pathlib

import numpy as np


def keys_of(values):
    """Of gtsam.Values or a factor, in any of the wheels."""
    keys = values.keys()
    return [keys.at(i) for i in range(keys.size())] if hasattr(keys, "at") else list(keys)


def quaternion(matrix):
    """x y z w of a rotation matrix."""
    w = np.sqrt(max(0.0, 1 + np.trace(matrix))) / 2
    if w > 1e-4:
        return np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0],
                         matrix[1, 0] - matrix[0, 1], 4 * w * w]) / (4 * w)
    values, vectors = np.linalg.eigh(matrix + matrix.T)
    return np.append(vectors[:, -1], 0.0)


def rotation(q):
    """Rotation matrix of a quaternion x y z w."""
    x, y, z, w = np.asarray(q) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def matrix_of(numbers):
    """4x4 of tx ty tz qx qy qz qw."""
    pose = np.eye(4)
    pose[:3, :3] = rotation(numbers[3:7])
    pose[:3, 3] = numbers[:3]
    return pose


def write_g2o(source, target, poses):
    """The source with the poses of its vertices replaced; poses: gtsam.Pose3 by id."""
    with open(source) as lines, open(target, "w") as out:
        for line in lines:
            words = line.split()
            if words and words[0] == "VERTEX_SE3:QUAT":
                pose = poses[int(words[1])]
                numbers = [*pose.translation(), *quaternion(pose.rotation().matrix())]
                line = " ".join(words[:2] + [f"{x:.17g}" for x in numbers]) + "\n"
            out.write(line)


@dataclasses.dataclass
class Bal:
    observations: list  # (camera, point, u, v)
    cameras: list
    points: list


def read_bal(path):
    numbers = iter(pathlib.Path(path).read_text().split())
    cameras, points, observations = (int(next(numbers)) for _ in range(3))
    seen = [(int(next(numbers)), int(next(numbers)), float(next(numbers)), float(next(numbers)))
            for _ in range(observations)]
    take = lambda count, size: [np.array([float(next(numbers)) for _ in range(size)])
                                for _ in range(count)]
    return Bal(seen, take(cameras, 9), take(points, 3))


def write_bal(path, problem):
    with open(path, "w") as out:
        out.write(f"{len(problem.cameras)} {len(problem.points)} {len(problem.observations)}\n")
        for camera, point, u, v in problem.observations:
            out.write(f"{camera} {point} {u:.17g} {v:.17g}\n")
        for block in [*problem.cameras, *problem.points]:
            out.writelines(f"{x:.17g}\n" for x in block)


@dataclasses.dataclass
class Stereo:
    camera: tuple  # ((fx, fy), cx, cy, baseline)
    sigma: float
    poses: list  # 4x4 world_from_cam
    points: list
    observations: list  # (pose, point, u_left, u_right, v)
    odometry: list  # 4x4 previous_from_current, the first None
    truth: list  # 4x4 world_from_cam


def read_stereo_graph(factors):
    """factors: the file with the factors, its two companions beside it."""
    name = factors.name
    near = lambda word: factors.with_name(name.replace("stereo_factors", word))
    calibration = near("calibration")
    if not calibration.exists():
        calibration = factors.with_name(name.split("stereo_factors")[0] + "calibration.txt")
    fx, fy, _, cx, cy, baseline = (float(x) for x in calibration.read_text().split()[:6])
    pose_index, poses = {}, []
    for row in near("camera_poses").read_text().splitlines():
        if row.split():
            pose_index[int(row.split()[0])] = len(poses)
            poses.append(np.array([float(x) for x in row.split()[1:17]]).reshape(4, 4))
    point_index, points, observations = {}, [], []
    for row in factors.read_text().splitlines():
        if not row.split():
            continue
        pose, landmark = (int(x) for x in row.split()[:2])
        left, right, v, *in_cam = (float(x) for x in row.split()[2:8])
        pose = pose_index[pose]
        if landmark not in point_index:
            point_index[landmark] = len(points)
            points.append(poses[pose][:3, :3] @ np.array(in_cam) + poses[pose][:3, 3])
        observations.append((pose, point_index[landmark], left, right, v))
    return Stereo(((fx, fy), cx, cy, baseline), 1.0, poses, points, observations, [], [])


def triangulate(camera, left, right, v):
    (fx, fy), cx, cy, baseline = camera
    z = fx * baseline / max(left - right, 1e-3)
    return np.array([(left - cx) * z / fx, (v - cy) * z / fy, z])


def read_stereo_stream(path):
    lines = iter(path.read_text().splitlines())
    words = next(lines).split()
    f, cx, cy, baseline = (float(x) for x in words[1:5])
    camera = ((f, f), cx, cy, baseline)
    problem = Stereo(camera, float(words[words.index("SIGMA_PX") + 1]), [], [], [], [], [])
    index = {}
    for line in lines:
        words = line.split()
        at = lambda key: matrix_of([float(x) for x in words[words.index(key) + 1:][:7]])
        problem.truth.append(at("GT"))
        problem.odometry.append(at("ODO") if "ODO" in words else None)
        pose = problem.truth[0] if len(problem.poses) == 0 else problem.poses[-1] @ problem.odometry[-1]
        problem.poses.append(pose)
        for _ in range(int(words[words.index("N") + 1])):
            landmark, left, right, v = next(lines).split()
            left, right, v = float(left), float(right), float(v)
            if landmark not in index:
                index[landmark] = len(problem.points)
                problem.points.append(pose[:3, :3] @ triangulate(camera, left, right, v) + pose[:3, 3])
            problem.observations.append((len(problem.poses) - 1, index[landmark], left, right, v))
    return problem


def write_stereo_graph(folder, problem):
    """As a stereo graph, the only format of the two with a place for landmarks. Its sigma is 1 px:
    costs are those of the stream times its variance."""
    folder.mkdir(parents=True, exist_ok=True)
    (fx, fy), cx, cy, baseline = problem.camera
    (folder / "calibration.txt").write_text(f"{fx!r} {fy!r} 0 {cx!r} {cy!r} {baseline!r}\n")
    with open(folder / "camera_poses.txt", "w") as out:
        for i, pose in enumerate(problem.poses):
            rows = [*pose[:3].flatten(), 0, 0, 0, 1]
            out.write(" ".join([str(i + 1)] + [f"{x:.17g}" for x in rows[:12]] + ["0 0 0 1"]) + "\n")
    with open(folder / "stereo_factors.txt", "w") as out:
        for pose, point, left, right, v in problem.observations:
            world_from_cam = problem.poses[pose]
            in_cam = world_from_cam[:3, :3].T @ (problem.points[point] - world_from_cam[:3, 3])
            numbers = [left, right, v, *in_cam]
            out.write(" ".join([f"{pose + 1} {point + 1}"] + [f"{x:.17g}" for x in numbers]) + "\n")
