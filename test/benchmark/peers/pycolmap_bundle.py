"""COLMAP's bundle adjustment on a BAL problem: `pycolmap_bundle.py bal INPUT OUTPUT`.

One RADIAL camera per image with its principal point held at the origin. COLMAP leaves out what lies
behind a camera: the score is over all observations of the result nevertheless.
"""

import sys

import numpy as np
import pycolmap

import formats
from measure import Stopwatch, report

FLIP = np.diag([1.0, -1.0, -1.0])  # BAL looks along -z with y up


def rodrigues(vector):
    angle = np.linalg.norm(vector)
    axis = vector / angle if angle > 0 else vector
    return formats.rotation(np.append(np.sin(angle / 2) * axis, np.cos(angle / 2)))


def rotation_vector(matrix):
    q = formats.quaternion(matrix)
    q = -q if q[3] < 0 else q
    sine = np.linalg.norm(q[:3])
    return q[:3] * (2 * np.arctan2(sine, q[3]) / sine if sine > 1e-12 else 2.0)


def reconstruction_of(problem):
    model = pycolmap.Reconstruction()
    by_image = [[] for _ in problem.cameras]
    tracks = [[] for _ in problem.points]
    for camera, point, u, v in problem.observations:
        tracks[point].append((camera, len(by_image[camera])))
        by_image[camera].append((u, -v))
    for i, block in enumerate(problem.cameras):
        camera = pycolmap.Camera(model="RADIAL", width=2000, height=2000, camera_id=i + 1,
                                 params=[block[6], 0, 0, block[7], block[8]])
        model.add_camera_with_trivial_rig(camera)
        image = pycolmap.Image(name=f"{i:06d}", camera_id=i + 1, image_id=i + 1,
                               keypoints=np.array(by_image[i]))
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(FLIP @ rodrigues(block[:3])), FLIP @ block[3:6])
        model.add_image_with_trivial_frame(image, pose)
    for point, track in zip(problem.points, tracks):
        elements = [pycolmap.TrackElement(image_id=i + 1, point2D_idx=k) for i, k in track]
        model.add_point3D(point, pycolmap.Track(elements=elements))
    return model


def main(_, source, target):
    problem = formats.read_bal(source)
    model = reconstruction_of(problem)
    options = pycolmap.BundleAdjustmentOptions(
        refine_focal_length=True, refine_extra_params=True, refine_principal_point=False)
    watch = Stopwatch()
    pycolmap.bundle_adjustment(model, options)
    times = watch.read()
    for i in range(len(problem.cameras)):
        pose = model.image(i + 1).cam_from_world()
        f, _, _, k1, k2 = model.camera(i + 1).params
        problem.cameras[i] = np.concatenate(
            [rotation_vector(FLIP @ pose.rotation.matrix()), FLIP @ pose.translation, [f, k1, k2]])
    left_out = 0
    for j in range(len(problem.points)):
        if model.exists_point3D(j + 1):
            problem.points[j] = model.point3D(j + 1).xyz
        else:
            left_out += 1
    formats.write_bal(target, problem)
    report(peer="pycolmap", points_left_out=left_out, **times)


if __name__ == "__main__":
    main(*sys.argv[1:])
