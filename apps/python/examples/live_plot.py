"""Draws path and landmarks from above while a dataset is tracked: live_plot.py DATASET (needs matplotlib)"""

import sys

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

import hybrid_slam

sequence = hybrid_slam.open_sequence(sys.argv[1])
session = hybrid_slam.Session(sequence.rig, drop=False)
path: list[NDArray[np.float64]] = []
figure, axes = plt.subplots()
for frame in sequence:
    session.push_stereo(frame.time, frame.left, frame.right)
    for result in session.results():
        if result.world_from_cam is not None:
            path.append(result.world_from_cam[:3, 3])
    if path and frame.index % 5 == 0:
        points, places = session.map().landmarks(), np.array(path)
        axes.clear()
        axes.plot(points[:, 0], points[:, 2], ",", color="grey")
        axes.plot(places[:, 0], places[:, 2], "r-")
        axes.set(aspect="equal", xlabel="x [m]", ylabel="z [m]", title=f"{len(points)} landmarks")
        plt.pause(0.001)
session.finish()
plt.show()
