"""Compares an estimated path with the true one: evaluate.py ESTIMATE TRUTH"""

import sys

import hybrid_slam

estimate, truth = (hybrid_slam.read_trajectory(path) for path in sys.argv[1:3])
absolute = hybrid_slam.ate(estimate, truth)
relative = hybrid_slam.rpe(estimate, truth)
print(f"ATE {absolute.position.rmse:.4f} m RMSE over {absolute.position.count} poses")
print(f"RPE {relative.translation.rmse:.4f} m, {relative.rotation.rmse:.5f} rad RMSE")
print(f"path {absolute.estimated_length:.2f} m of {absolute.true_length:.2f} m")
