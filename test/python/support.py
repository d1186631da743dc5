"""What the tests share: a skip with a word where numpy is missing, and images of a known motion."""

import sys

try:
    import numpy as np
except ImportError:
    print("SKIPPED: no numpy")
    sys.exit(0)

import hybrid_slam as hs

WIDTH, HEIGHT, FOCAL, BASELINE = 320, 240, 200.0, 0.1
DISPARITY, STEP, PERIOD = 20, 5, 100_000_000  # [px], [px per frame], [ns]
DEPTH = FOCAL * BASELINE / DISPARITY  # of a wall in front of the cameras [m]


def rig() -> hs.CameraRig:
    return hs.CameraRig(
        hs.Camera.rectified_stereo(FOCAL, FOCAL, 159.5, 119.5, BASELINE, WIDTH, HEIGHT)
    )


def wall(width: int) -> np.ndarray:
    """Spots of several sizes: noise of several resolutions."""
    noise = np.random.default_rng(1)
    sum_of = np.zeros((HEIGHT, width))
    for cell in (3, 6, 12, 24):
        coarse = noise.standard_normal((HEIGHT // cell + 2, width // cell + 2))
        for axis, size in ((0, HEIGHT), (1, width)):
            at = np.arange(size) / cell
            low = at.astype(int)
            share = (at - low).reshape((-1, 1) if axis == 0 else (1, -1))
            coarse = np.take(coarse, low, axis) * (1 - share) + np.take(coarse, low + 1, axis) * share
        sum_of += coarse
    return np.clip(128 + 35 * sum_of, 0, 255).astype(np.uint8)


def recording(frames: int) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Cameras that go to the right along the wall, STEP * DEPTH / FOCAL [m] per frame."""
    picture = wall(WIDTH + DISPARITY + STEP * frames)
    pairs = []
    for i in range(frames):
        x = STEP * i
        left = picture[:, x : x + WIDTH]
        right = picture[:, x + DISPARITY : x + DISPARITY + WIDTH]
        pairs.append((i * PERIOD, left, right))
    return pairs
