#!/usr/bin/env python3
"""Installs the peers' released wheels from PyPI into virtual environments outside the repository."""

import os
import pathlib
import subprocess
import sys
import venv

# By name and version: a table is comparable only with the wheels it was made with.
ENVIRONMENTS = {
    "newest": ["gtsam==4.3.0", "pycolmap==4.2.1", "pyceres==2.6"],
    "gtsam42": ["gtsam==4.2", "numpy<2"],
}


def root() -> pathlib.Path:
    cache = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return pathlib.Path(cache).expanduser() / "hybrid_slam" / "peers"


def python(environment: str) -> pathlib.Path:
    """The environment's interpreter; installs what is missing."""
    folder = root() / environment
    done = folder / "installed.txt"
    wanted = "\n".join(ENVIRONMENTS[environment]) + "\n"
    interpreter = folder / "bin" / "python"
    if not done.exists() or done.read_text() != wanted:
        venv.create(folder, with_pip=True, clear=True)
        subprocess.run([interpreter, "-m", "pip", "install", "--quiet", *ENVIRONMENTS[environment]],
                       check=True)
        done.write_text(wanted)
    return interpreter


if __name__ == "__main__":
    for name in ENVIRONMENTS:
        print(python(name), file=sys.stderr)
