"""Recursive Gaussian process regression of a fixed star-convex contour.

Thesis section 5.4.2, (57)-(60) and Figure 8; Huber 2014, *Recursive Gaussian process*: a filter
whose state is the radius at the basis angles. The picture shows the target's shape on the plane,
and the same shape as a radial function. The radius is learnt from noisy points that come ten at a
time; angles without points keep their uncertainty.

    python examples/recursive_gp.py PICTURE

writes the picture (PNG, SVG, PDF) to PICTURE.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from stixel_cli.randomness import generator
from stixel_cli.tracking.kernel import ContourProcess

STD = 0.08  # of a measured radius, m
PER_BATCH = 10
SHOWN = (1, 4, 20)  # batches
TRUTH, ESTIMATE, POINTS = "#444444", "#0072b2", "#d55e00"


def start(process: ContourProcess) -> tuple[np.ndarray, np.ndarray]:
    """Mean (N,) m and covariance (N, N) m² before any value: x^f ~ N(0, K)."""
    return np.zeros(len(process.basis_angles)), process.covariance.copy()


def update(
    mean: np.ndarray,
    covariance: np.ndarray,
    angles: np.ndarray,
    radii: np.ndarray,
    std: float,
    process: ContourProcess,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (N,) m and covariance (N, N) m² with a batch of values.

    `radii` (n,) m were measured at `angles` (n,) rad with a standard deviation `std` in m:
    r = H^f x^f + e with e ~ N(0, R^f + R), and the values of a batch are taken as independent given
    the basis points, thesis (49).
    """
    matrix, variances = process.at(angles)
    innovation_covariance = matrix @ covariance @ matrix.T + np.diag(variances + std**2)
    gain = np.linalg.solve(innovation_covariance, matrix @ covariance).T
    updated = covariance - gain @ innovation_covariance @ gain.T
    return mean + gain @ (radii - matrix @ mean), 0.5 * (updated + updated.T)


def radius(
    mean: np.ndarray, covariance: np.ndarray, angles: np.ndarray, process: ContourProcess
) -> tuple[np.ndarray, np.ndarray]:
    """Radius (n,) and its standard deviation (n,) in m at `angles` (n,) rad."""
    matrix, variances = process.at(angles)
    spread = np.einsum("ij,ij->i", matrix @ covariance, matrix)
    return matrix @ mean, np.sqrt(np.maximum(spread, 0.0) + variances)


def true_radius(angles):
    """Radius in m of a shape about 4 m × 2 m: an ellipse with a bulge on each side."""
    ellipse = 2.0 * 1.0 / np.hypot(1.0 * np.cos(angles), 2.0 * np.sin(angles))
    return ellipse + 0.12 * np.cos(4.0 * angles)


def on_the_plane(radii, angles):
    """x and y in m of points of a contour."""
    return radii * np.cos(angles), radii * np.sin(angles)


def draw(plane, function, angles, mean, std, seen_angles, seen_radii):
    """Draw one column: the contour on the plane (top) and its radial function (bottom)."""
    low, high = np.maximum(mean - 2.0 * std, 0.0), mean + 2.0 * std
    ring = [
        np.concatenate(pair)
        for pair in zip(
            on_the_plane(high, angles),
            (part[::-1] for part in on_the_plane(low, angles)),
            strict=True,
        )
    ]
    plane.fill(*ring, color=ESTIMATE, alpha=0.2, lw=0, label="± 2 standard deviations")
    plane.plot(*on_the_plane(true_radius(angles), angles), color=TRUTH, ls="--", label="truth")
    plane.plot(*on_the_plane(mean, angles), color=ESTIMATE, label="estimate")
    plane.plot(*on_the_plane(seen_radii, seen_angles), ".", color=POINTS, ms=4, label="points")
    plane.plot(0.0, 0.0, "+", color=TRUTH)
    plane.set(aspect="equal", xlim=(-3.2, 3.2), ylim=(-2.6, 2.6), xlabel="x (m)")

    turn = np.degrees(angles)
    function.fill_between(turn, low, high, color=ESTIMATE, alpha=0.2, lw=0)
    function.plot(turn, true_radius(angles), color=TRUTH, ls="--")
    function.plot(turn, mean, color=ESTIMATE)
    function.plot(np.degrees(seen_angles), seen_radii, ".", color=POINTS, ms=4)
    function.set(xlim=(0, 360), ylim=(0, 3.6), xlabel="angle (°)", xticks=range(0, 361, 90))


def main(picture: Path) -> None:
    """Estimate the contour and draw it after some of the batches."""
    process = ContourProcess(
        basis_points=50, length_scale=np.pi / 8, sigma_f=0.5, sigma_r=1.5, jitter=1e-6
    )
    mean, covariance = start(process)
    angles = np.linspace(0.0, 2.0 * np.pi, 361)
    figure, axes = plt.subplots(2, len(SHOWN), figsize=(11, 6.4), layout="constrained")
    seen_angles, seen_radii = np.zeros(0), np.zeros(0)
    for batch in range(1, SHOWN[-1] + 1):
        random = generator(0, "example", batch)
        new = random.uniform(0.0, 2.0 * np.pi, PER_BATCH)
        radii = true_radius(new) + STD * random.standard_normal(PER_BATCH)
        mean, covariance = update(mean, covariance, new, radii, STD, process)
        seen_angles, seen_radii = np.append(seen_angles, new), np.append(seen_radii, radii)
        if batch in SHOWN:
            found, std = radius(mean, covariance, angles, process)
            plane, function = axes[:, SHOWN.index(batch)]
            draw(plane, function, angles, found, std, seen_angles, seen_radii)
            error = np.sqrt(np.mean((found - true_radius(angles)) ** 2))
            plane.set_title(f"after {PER_BATCH * batch} points: RMSE {error:.2f} m")
    axes[0, 0].set_ylabel("y (m)")
    axes[1, 0].set_ylabel("radius (m)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    figure.savefig(picture, dpi=130)
    plt.close(figure)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("picture", type=Path, help="file to write: .png, .svg or .pdf")
    main(parser.parse_args().picture)
