"""The stubs say what the module has, and the examples are clean under mypy --strict."""

import os
import subprocess
import sys
import tempfile
import unittest

from support import hs  # noqa: F401  # skips where it must

try:
    import mypy  # noqa: F401
except ImportError:
    print("SKIPPED: no mypy")
    sys.exit(0)


# Of classes that pybind11 makes: their metaclass, that most have no __init__ of their own, and that sequences are
# iterated by their __getitem__.
EXPECTED = r"""
hybrid_slam\.\w+
hybrid_slam\.\w+\.__init__
hybrid_slam\.Sequence\.__iter__
"""


class Typing(unittest.TestCase):
    def run_module(self, *arguments: str) -> None:
        environment = {**os.environ, "MYPYPATH": os.environ["PYTHONPATH"]}
        command = [sys.executable, "-m", *arguments]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_stubs(self) -> None:
        with tempfile.NamedTemporaryFile("w") as allowed:
            allowed.write(EXPECTED)
            allowed.flush()
            self.run_module("mypy.stubtest", "hybrid_slam", "--concise", "--allowlist", allowed.name)

    def test_strict(self) -> None:
        examples = os.environ["HYBRID_SLAM_EXAMPLES"]
        files = [os.path.join(examples, name) for name in sorted(os.listdir(examples)) if name != "live_plot.py"]
        self.run_module("mypy", "--strict", *files)


if __name__ == "__main__":
    unittest.main()
