import os
import tempfile
import threading
import unittest

from support import DEPTH, FOCAL, PERIOD, STEP, hs, np, recording, rig

FRAMES = 12


def tracked() -> hs.Session:
    session = hs.Session(rig(), hs.Options(features=500), mode="every-frame")
    for time, left, right in recording(FRAMES):
        assert session.push_stereo(time, left, right) == "taken"
    session.finish()
    return session


class Sessions(unittest.TestCase):
    session = tracked()

    def test_path(self) -> None:
        path = self.session.trajectory()
        np.testing.assert_allclose(path.times, np.arange(FRAMES) * PERIOD / 1e9)
        true_x = np.arange(FRAMES) * STEP * DEPTH / FOCAL
        np.testing.assert_allclose(path.positions[:, 0], true_x, atol=0.002)
        np.testing.assert_allclose(path.positions[:, 1:], 0, atol=0.005)
        pose = self.session.pose_at("stereo", 3 * PERIOD)
        assert pose is not None
        np.testing.assert_allclose(pose, path.world_from_cam[3], atol=1e-12)
        self.assertIsNone(self.session.pose_at("stereo", -PERIOD))

    def test_results(self) -> None:
        results = tracked().results()
        self.assertEqual([r.time for r in results], [i * PERIOD for i in range(FRAMES)])
        self.assertIsNone(results[0].covariance_base)  # exact: the world begins here
        last = results[-1]
        self.assertEqual((last.camera, last.state), ("stereo", "map"))
        self.assertEqual(last.covariance.shape, (6, 6))
        self.assertTrue((np.linalg.eigvalsh(last.covariance) > 0).all())
        self.assertLess(np.sqrt(last.covariance[0, 0]), 0.01)
        assert last.world_from_cam is not None and last.cam_from_world is not None
        np.testing.assert_allclose(last.world_from_cam @ last.cam_from_world, np.eye(4), atol=1e-12)
        self.assertGreater(last.inliers, 50)

    def test_map(self) -> None:
        world = self.session.map()
        points = world.landmarks()
        self.assertEqual(points.shape, (world.landmark_count, 3))
        self.assertAlmostEqual(float(np.median(points[:, 2])), DEPTH, delta=0.01)
        keyframes = world.keyframe_ids()
        self.assertEqual(world.keyframe_poses().shape, (len(keyframes), 4, 4))
        ids, pixels = world.observations(int(keyframes[0]))
        camera = world.cameras[0]
        rows = np.searchsorted(world.landmark_ids(), ids)
        seen = camera.project_stereo(points[rows])
        self.assertLess(np.nanmedian(np.abs(seen - pixels)), 0.5)
        with self.assertRaises(KeyError):
            world.observations(10**6)

    def test_map_goes_into_a_file_and_back(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path, again = os.path.join(folder, "map.hslam"), os.path.join(folder, "again.hslam")
            self.session.save(path)
            loaded = hs.load_map(path)
            loaded.save(again)
            with open(path, "rb") as one, open(again, "rb") as other:
                self.assertEqual(one.read(), other.read())
            np.testing.assert_array_equal(loaded.landmarks(), self.session.map().landmarks())
            self.assertIn(hs.__version__, loaded.program)
            session = hs.Session(rig(), map=path, localize=True, mode="every-frame")
            time, left, right = recording(FRAMES)[6]
            found = session.track_stereo(time, left, right)
            assert found is not None and found.world_from_cam is not None
            self.assertEqual(found.state, "relocalised")
            true_x = 6 * STEP * DEPTH / FOCAL
            self.assertAlmostEqual(found.world_from_cam[0, 3], true_x, delta=0.005)
            with self.assertRaisesRegex(hs.OutputError, "nowhere"):
                session.save("/nowhere/map.hslam")

    def test_same_bytes_however_the_array_lies(self) -> None:
        session = hs.Session(rig(), hs.Options(features=500), mode="every-frame")
        for time, left, right in recording(FRAMES):
            backwards = np.ascontiguousarray(right[::-1, ::-1])[::-1, ::-1]
            session.push_stereo(time, np.asfortranarray(left), backwards)
        session.finish()
        np.testing.assert_array_equal(
            session.trajectory().world_from_cam, self.session.trajectory().world_from_cam
        )

    def test_realtime_from_a_thread(self) -> None:
        session = hs.Session(rig(), hs.Options(features=500), drop=False)
        ticks = 0
        feeder = threading.Thread(
            target=lambda: [session.push_stereo(*moment) for moment in recording(FRAMES)]
        )
        feeder.start()
        while feeder.is_alive():  # Python runs while the SLAM works
            ticks += 1
            feeder.join(0.001)
        session.finish()
        self.assertGreater(ticks, 0)
        self.assertEqual(len(session.results()), FRAMES)
        self.assertEqual(session.counts()["stereo"]["taken"], FRAMES)

    def test_refused(self) -> None:
        session = hs.Session(rig())
        image = np.zeros((240, 320), np.uint8)
        with self.assertRaisesRegex(hs.UsageError, "left is no grey image"):
            session.push_stereo(0, image.astype(float), image)
        with self.assertRaisesRegex(hs.UsageError, "right is no grey image"):
            session.push_stereo(0, image, np.zeros((240, 320, 3), np.uint8))
        self.assertNotEqual(session.push_stereo(0, image[:100], image), "taken")
        self.assertNotEqual(session.push_fisheye(0, image), "taken")
        self.assertEqual(session.counts()["stereo"]["refused"], 1)
        with self.assertRaisesRegex(hs.UsageError, "mode"):
            hs.Session(rig(), mode="fast")  # type: ignore[arg-type]
        with self.assertRaises(hs.UsageError):
            hs.Options(features=-1)


if __name__ == "__main__":
    unittest.main()
