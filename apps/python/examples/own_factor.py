"""An incremental graph with a factor of one's own: the range to a beacon whose place is not known."""

import numpy as np
from numpy.typing import NDArray

import hybrid_slam

Array = NDArray[np.float64]


def main() -> None:
    truth = np.array([4.0, 3.0, 8.0])
    graph = hybrid_slam.Graph()
    beacon = graph.add_block(np.array([3.0, 2.0, 9.0]))
    last, last_from_world = None, np.eye(4)
    for i in range(12):  # round a bend, so that three coordinates can be told
        cam_from_world = np.eye(4)
        cam_from_world[:3, 3] = [-0.5 * i, -0.1 * i * i, -(i % 3)]
        pose = graph.add_pose(cam_from_world, fixed=i == 0)
        if last is not None:
            motion = last_from_world @ np.linalg.inv(cam_from_world)
            graph.add_edge(last, pose, motion, 1e4 * np.eye(6))
        heard = float(np.linalg.norm(cam_from_world[:3, :3] @ truth + cam_from_world[:3, 3]))

        def off(cam_from_world: Array, at: Array, heard: float = heard) -> Array:
            distance = np.linalg.norm(cam_from_world[:3, :3] @ at + cam_from_world[:3, 3])
            return np.array([(distance - heard) / 0.1])

        graph.add_factor(off, [pose, beacon])
        graph.update()
        last, last_from_world = pose, cam_from_world
    sigma = np.sqrt(np.trace(graph.covariance([beacon])))
    print(f"beacon at {graph.value(beacon)}, in truth {truth}, +- {sigma:.2f} m")


if __name__ == "__main__":
    main()
