import os
import subprocess
import sys
import tempfile
import unittest

from support import hs, np


class Cameras(unittest.TestCase):
    def test_projection_and_back(self) -> None:
        camera = hs.Camera.kannala_brandt(320, 321, 511, 512, 0.05, -0.01, 0.002, -0.0005, 1024, 1024)
        points = np.array([[0.3, -0.2, 1.0], [2.0, 1.0, 0.5], [0.0, 0.0, 2.0]])
        pixels = camera.project(points)
        self.assertEqual(pixels.shape, (3, 2))
        np.testing.assert_allclose(pixels[2], [511, 512], atol=1e-9)
        bearings = points / np.linalg.norm(points, axis=1, keepdims=True)
        np.testing.assert_allclose(camera.unproject(pixels), bearings, atol=1e-9)

    def test_stereo(self) -> None:
        camera = hs.Camera.rectified_stereo(400, 400, 320, 240, 0.12, 640, 480)
        points = np.array([[0.1, 0.2, 2.0], [0.0, 0.0, -1.0]])
        seen = camera.project_stereo(points)
        np.testing.assert_allclose(seen[0], [340, 280, 340 - 400 * 0.12 / 2], atol=1e-9)
        self.assertTrue(np.isnan(seen[1]).all())
        np.testing.assert_allclose(camera.triangulate(seen)[0], points[0], atol=1e-9)
        self.assertEqual((camera.model, camera.width, camera.height), ("rectified_stereo", 640, 480))

    def test_errors_are_ours(self) -> None:
        pinhole = hs.Camera.pinhole(400, 400, 320, 240, 640, 480)
        with self.assertRaisesRegex(hs.UsageError, "stereo is a pinhole camera"):
            hs.CameraRig(pinhole)
        with self.assertRaisesRegex(hs.InputError, "nowhere"):
            hs.read_fisheye("/nowhere.yaml")
        self.assertTrue(issubclass(hs.UsageError, ValueError))
        self.assertTrue(issubclass(hs.InputError, hs.Error))


class NumPy(unittest.TestCase):
    def test_one_that_the_build_does_not_know_is_refused(self) -> None:
        # Debian's pybind11, which the build folder has, knows NumPy 1 alone.
        with tempfile.TemporaryDirectory() as folder:
            package = os.path.join(folder, "numpy")
            os.mkdir(package)
            with open(os.path.join(package, "__init__.py"), "w") as file:
                file.write('__version__ = "2.1.0"\n')
            paths = os.pathsep.join([folder, os.environ["PYTHONPATH"]])
            tried = subprocess.run([sys.executable, "-c", "import hybrid_slam"], capture_output=True,
                                   text=True, env={**os.environ, "PYTHONPATH": paths})
        self.assertEqual(tried.returncode, 1)
        self.assertIn("does not know NumPy 2.1.0: install numpy<2", tried.stderr)


class Images(unittest.TestCase):
    def test_what_was_written_is_read(self) -> None:
        pixels = np.arange(6, dtype=np.uint8).reshape(2, 3)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "image.pgm")
            with open(path, "wb") as file:
                file.write(b"P5\n3 2\n255\n" + pixels.tobytes())
            read = hs.read_image(path)
        np.testing.assert_array_equal(read, pixels)
        self.assertFalse(read.flags.owndata)  # the decoder's own memory

    def test_no_image(self) -> None:
        with self.assertRaisesRegex(hs.UsageError, "channel \"pink\" is none of"):
            hs.read_image("x.png", channel="pink")


class Trajectories(unittest.TestCase):
    def test_errors(self) -> None:
        times = np.arange(20.0)
        truth = np.tile(np.eye(4), (20, 1, 1))
        truth[:, 0, 3], truth[:, 1, 3] = times, 0.1 * times**2
        turn = np.array([[0.0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])
        estimate = turn @ truth
        moved = estimate.copy()
        moved[:, 2, 3] += np.where(np.arange(20) % 2 == 0, 0.03, -0.03)  # across, zero mean
        true_path = hs.Trajectory(times, truth)
        exact = hs.ate(hs.Trajectory(times, estimate), true_path)
        self.assertLess(exact.position.rmse, 1e-9)
        np.testing.assert_allclose(exact.truth_from_estimate, np.linalg.inv(turn), atol=1e-9)
        off = hs.ate(hs.Trajectory(times, moved), true_path)
        self.assertAlmostEqual(off.position.rmse, 0.03, delta=5e-4)
        steps = hs.rpe(hs.Trajectory(times, moved), true_path)
        self.assertAlmostEqual(steps.translation.rmse, 0.06, places=9)
        self.assertEqual(steps.translation.count, 19)

    def test_file(self) -> None:
        pose = np.eye(4)
        pose[:3, 3] = [1, 2, 3]
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "path.tum")
            hs.Trajectory([1.5], [pose]).write_tum(path)
            read = hs.read_trajectory(path)
        np.testing.assert_allclose(read.world_from_cam, [pose])
        np.testing.assert_array_equal(read.times, [1.5])
        np.testing.assert_array_equal(read.positions, [[1, 2, 3]])

    def test_no_poses(self) -> None:
        with self.assertRaisesRegex(hs.UsageError, "rigid"):
            hs.Trajectory([0.0], [2 * np.eye(4)])
        with self.assertRaisesRegex(hs.UsageError, "ascend"):
            hs.Trajectory([1.0, 1.0], [np.eye(4), np.eye(4)])


if __name__ == "__main__":
    unittest.main()
