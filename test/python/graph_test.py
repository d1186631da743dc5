import unittest

from support import hs, np

EYE = np.eye(4)


def moved(x: float, y: float = 0, z: float = 0) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = [x, y, z]
    return pose


class Solver(unittest.TestCase):
    def test_edges(self) -> None:
        graph = hs.Graph()
        first = graph.add_pose(EYE, fixed=True)
        second = graph.add_pose(moved(3))
        graph.add_edge(first, second, moved(1), 100 * np.eye(6))
        graph.add_edge(first, second, moved(2), 300 * np.eye(6))
        summary = graph.update()
        self.assertIn(second, summary.moved)
        np.testing.assert_allclose(graph.value(second), moved(-1.75), atol=1e-6)

    def test_covariance(self) -> None:
        graph = hs.Graph()
        first = graph.add_pose(EYE, fixed=True)
        second = graph.add_pose(moved(-1))
        graph.add_edge(first, second, moved(1), np.diag([100.0, 200, 300, 400, 500, 600]))
        graph.update()
        expected = np.diag(1 / np.array([100.0, 200, 300, 400, 500, 600]))
        np.testing.assert_allclose(graph.covariance([second]), expected, atol=1e-12)

    def test_observations(self) -> None:
        camera = hs.Camera.rectified_stereo(400, 400, 320, 240, 0.12, 640, 480)
        truth = np.array([[0.1, -0.2, 3.0]])
        graph = hs.Graph()
        pose = graph.add_pose(EYE, camera=graph.add_camera(camera), fixed=True)
        point = graph.add_point([0.2, 0.0, 4.0])
        seen = graph.add_observation(pose, point, camera.project_stereo(truth)[0], 0.5)
        for _ in range(5):
            graph.update()
        np.testing.assert_allclose(graph.value(point), truth[0], atol=1e-5)
        self.assertLess(graph.chi2(seen), 1e-6)


def range_of(pose: np.ndarray, beacon: np.ndarray) -> np.ndarray:
    return pose[:3, :3] @ beacon + pose[:3, 3]


class OwnFactors(unittest.TestCase):
    places = [moved(-x, -y, -z) for x, y, z in [(0, 0, 0), (2, 0, 1), (0, 3, 0), (1, 1, 4)]]
    truth = np.array([4.0, 3.0, 8.0])

    def solve(self, analytic: bool) -> tuple[np.ndarray, np.ndarray]:
        graph = hs.Graph()
        beacon = graph.add_block([3.0, 2.0, 9.0])
        poses = [graph.add_pose(place) for place in self.places]
        for pose, place in zip(poses, self.places):
            graph.add_factor(self.prior(place), [pose])
            distance = float(np.linalg.norm(range_of(place, self.truth)))

            def off(cam_from_world, at, distance=distance):
                seen = range_of(cam_from_world, at)
                length = np.linalg.norm(seen)
                residual = np.array([(length - distance) / 0.1])
                if not analytic:
                    return residual
                ray = seen / length / 0.1
                # d exp(d) p = d_translation + d_rotation x p
                by_pose = np.concatenate([ray, np.cross(seen, ray)]).reshape(1, 6)
                return residual, [by_pose, (ray @ cam_from_world[:3, :3]).reshape(1, 3)]

            graph.add_factor(off, [pose, beacon], loss="huber", threshold=3.84)
        for _ in range(5):
            graph.update()
        return graph.value(beacon), graph.covariance([beacon, poses[1]])

    @staticmethod
    def prior(place):
        def residual(cam_from_world):
            error = cam_from_world @ np.linalg.inv(place)
            turn = [error[2, 1] - error[1, 2], error[0, 2] - error[2, 0], error[1, 0] - error[0, 1]]
            return np.concatenate([error[:3, 3], 0.5 * np.array(turn)]) / 0.01

        return residual

    def test_beacon(self) -> None:
        found, covariance = self.solve(analytic=False)
        np.testing.assert_allclose(found, self.truth, atol=1e-4)
        again, covariance_again = self.solve(analytic=True)
        np.testing.assert_allclose(again, self.truth, atol=1e-4)
        np.testing.assert_allclose(covariance, covariance_again, rtol=1e-5, atol=1e-9)

    def test_what_is_raised_comes_back(self) -> None:
        graph = hs.Graph()
        block = graph.add_block([1.0])
        fails = False

        def factor(value):
            if fails:
                raise KeyError("no such thing")
            return value

        graph.add_factor(factor, [block])
        fails = True
        with self.assertRaisesRegex(KeyError, "no such thing"):
            graph.update()

    def test_usage(self) -> None:
        graph = hs.Graph()
        point = graph.add_point([0.0, 0, 1])
        with self.assertRaisesRegex(hs.UsageError, "no pose"):
            graph.add_edge(point, point, EYE, np.eye(6))
        graph.remove(point)
        with self.assertRaisesRegex(hs.UsageError, "not in the graph"):
            graph.value(point)
        block = graph.add_block([1.0, 2.0])
        with self.assertRaisesRegex(hs.UsageError, "no vector of numbers"):
            graph.add_factor(lambda value: "x", [block])

        def wrong_shape(value):
            return value, [np.zeros((2, 3))]

        with self.assertRaisesRegex(hs.UsageError, r"\(2, 2\)"):
            graph.add_factor(wrong_shape, [block])
            graph.update()


if __name__ == "__main__":
    unittest.main()
