"""Ten lines of Python give the same bytes as the program, on real images; and the example scripts run."""

import os
import subprocess
import sys
import tempfile
import unittest

from support import hs

DATA = os.environ.get("HYBRID_SLAM_DATA")
if not DATA:
    print("SKIPPED: HYBRID_SLAM_DATA is not set")
    sys.exit(0)


class Program(unittest.TestCase):
    def test_kitti(self) -> None:
        dataset = os.path.join(DATA, "kitti")
        with tempfile.TemporaryDirectory() as folder:
            ours, theirs = os.path.join(folder, "python"), os.path.join(folder, "program")
            program = os.environ["HYBRID_SLAM_PROGRAM"]
            subprocess.run([program, dataset, "--out", theirs, "--quiet"], check=True, stdout=subprocess.DEVNULL)
            os.makedirs(ours)
            sequence = hs.open_sequence(dataset)
            session = hs.Session(sequence.rig, mode="every-frame")
            for frame in sequence:
                session.push_stereo(frame.time, frame.left, frame.right)
            session.finish()
            session.trajectory().write_tum(os.path.join(ours, "stereo.tum"))
            session.trajectory(online=True).write_tum(os.path.join(ours, "stereo_online.tum"))
            for name in ("stereo.tum", "stereo_online.tum"):
                with open(os.path.join(ours, name)) as one, open(os.path.join(theirs, name)) as other:
                    text = one.read()
                    self.assertEqual(text, other.read())
                self.assertEqual(text.count("\n"), len(sequence))
            self.assertLess(hs.ate(session.trajectory(), sequence.truth).position.rmse, 0.2)
            self.run_example("evaluate.py", os.path.join(ours, "stereo.tum"), os.path.join(theirs, "stereo.tum"))

    def test_own_factor(self) -> None:
        self.assertIn("beacon at", self.run_example("own_factor.py"))

    def test_scripts_that_track(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            few, out = few_frames(folder, 8), os.path.join(folder, "out")
            said = self.run_example("run_folder.py", few, out, "few")
            self.assertEqual(said.count(" stereo "), 8)
            self.assertEqual(len(hs.read_trajectory(os.path.join(out, "stereo.tum"))), 8)
            self.assertGreater(len(hs.load_map(os.path.join(out, "map.hslam")).landmarks()), 100)
            try:
                import matplotlib  # noqa: F401
            except ImportError:
                print("without live_plot.py: no matplotlib")
                return
            self.run_example("live_plot.py", few)

    def run_example(self, name: str, *arguments: str) -> str:
        script = os.path.join(os.environ["HYBRID_SLAM_EXAMPLES"], name)
        environment = {**os.environ, "MPLBACKEND": "Agg"}  # draws without a screen
        done = subprocess.run([sys.executable, script, *arguments], capture_output=True, text=True, env=environment)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout


def few_frames(folder: str, count: int) -> str:
    """The beginning of KITTI's sequence."""
    whole = os.path.join(DATA, "kitti", "sequences", "s1")
    part = os.path.join(folder, "data", "sequences", "few")
    for images in ("image_0", "image_1"):
        os.makedirs(os.path.join(part, images))
        for name in sorted(os.listdir(os.path.join(whole, images)))[:count]:
            os.symlink(os.path.join(whole, images, name), os.path.join(part, images, name))
    os.symlink(os.path.join(whole, "calib.txt"), os.path.join(part, "calib.txt"))
    with open(os.path.join(whole, "times.txt")) as times, open(os.path.join(part, "times.txt"), "w") as few:
        few.writelines(times.readlines()[:count])
    return os.path.join(folder, "data")


if __name__ == "__main__":
    unittest.main()
