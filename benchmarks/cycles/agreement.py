"""Do two renderers converge to the same image? Tests on the means of many independent runs.

Both sides come as N pictures of the same scene with different seeds. Their spread gives the variance of each block
of pixels, so that nothing is assumed about either renderer's noise; small N is accounted for by Welch's t-test.

@source  B. L. Welch 1947, "The generalization of 'Student's' problem when several different population variances are
         involved"; the incomplete beta function by the continued fraction of Abramowitz & Stegun 26.5.8.
"""

import math
from dataclasses import dataclass

import numpy as np


@dataclass
class Agreement:
    """What a comparison of two stacks of runs found. p-values are corrected for the number of values looked at."""

    passed: bool
    block_p: float  # of the most different block of pixels
    mean_p: float  # of the most different channel's image mean
    small_p_fraction: float  # blocks whose own p is below 0.05; about 0.05 if the images agree
    relative_difference: float  # of the image means, a/b − 1
    relative_standard_error: float  # of that difference
    num_blocks: int
    worst_block: tuple  # (x, y) of its first pixel
    worst_block_ratio: float  # a/b in it


def compare_runs(a, b, block=8, significance=0.01):
    """Tests whether two renderers have the same expected image.

    @param  a, b          arrays of shape (runs, height, width, 3), at least two runs each, independent seeds
    @param  block         side of the blocks of pixels; incomplete ones at the right and the bottom are left out
    @param  significance  chance that two equal renderers fail, shared by the two tests
    @return               Agreement
    """
    blocks_a, blocks_b = _block_means(a, block), _block_means(b, block)
    p = welch_p(blocks_a, blocks_b)
    worst = np.unravel_index(np.argmin(p), p.shape)
    num_blocks = p.shape[0] * p.shape[1]
    block_p = min(1.0, float(p[worst]) * p.size)
    means_a, means_b = a.mean(axis=(1, 2)), b.mean(axis=(1, 2))
    mean_p = min(1.0, float(welch_p(means_a, means_b).min()) * 3)
    gray_a, gray_b = means_a.mean(axis=1), means_b.mean(axis=1)
    variance = gray_a.var(ddof=1) / len(gray_a) + gray_b.var(ddof=1) / len(gray_b)
    ratio = blocks_a[(slice(None), *worst)].mean() / max(blocks_b[(slice(None), *worst)].mean(), 1e-12)
    return Agreement(
        passed=block_p >= significance / 2 and mean_p >= significance / 2,
        block_p=block_p,
        mean_p=mean_p,
        small_p_fraction=float((p < 0.05).mean()),
        relative_difference=float(gray_a.mean() / gray_b.mean() - 1),
        relative_standard_error=float(math.sqrt(variance) / gray_b.mean()),
        num_blocks=num_blocks,
        worst_block=(int(worst[1]) * block, int(worst[0]) * block),
        worst_block_ratio=float(ratio),
    )


def _block_means(runs, block):
    """Means over blocks of pixels: shape (runs, rows, columns, 3)."""
    count, height, width, channels = runs.shape
    rows, columns = height // block, width // block
    cropped = runs[:, : rows * block, : columns * block]
    return cropped.reshape(count, rows, block, columns, block, channels).mean(axis=(2, 4))


def welch_p(a, b):
    """Two-sided p-values that the means over axis 0 are equal; 1 where both sides are constant and equal."""
    variance_a, variance_b = a.var(axis=0, ddof=1) / len(a), b.var(axis=0, ddof=1) / len(b)
    variance = variance_a + variance_b
    difference = a.mean(axis=0) - b.mean(axis=0)
    # Constants (a lamp, the sky) have no variance; stored halves and floats still round.
    rounding = (np.abs(a.mean(axis=0)) * 2.0**-11) ** 2 / 12
    variance = np.maximum(variance, rounding + 1e-30)
    t = difference / np.sqrt(variance)
    denominator = variance_a**2 / (len(a) - 1) + variance_b**2 / (len(b) - 1)
    most = len(a) + len(b) - 2
    freedom = np.where(denominator > 0, variance**2 / np.maximum(denominator, 1e-300), most)
    freedom = np.clip(freedom, min(len(a), len(b)) - 1, most)
    flat = [student_p(value, degrees) for value, degrees in zip(np.ravel(t), np.ravel(freedom))]
    return np.array(flat).reshape(np.shape(t))


def student_p(t, freedom):
    """Chance that Student's t with `freedom` degrees of freedom lies at least |t| from 0."""
    return _incomplete_beta(freedom / 2, 0.5, freedom / (freedom + t * t))


def _incomplete_beta(a, b, x):
    """Regularized incomplete beta function I_x(a, b)."""
    if x <= 0 or x >= 1:
        return min(max(x, 0.0), 1.0)
    if x > (a + 1) / (a + b + 2):
        return 1 - _incomplete_beta(b, a, 1 - x)
    log_front = (
        math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x)
    )
    # Lentz's evaluation of the continued fraction; converges within some 30 terms for x below the mean.
    c, d = 1.0, 1.0 / (1 - (a + b) * x / (a + 1))
    fraction = d
    for m in range(1, 300):
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        step = 1.0
        for term in (even, odd):
            d = 1 / (1 + term * d)
            c = 1 + term / c
            step = c * d
            fraction *= step
        if abs(step - 1) < 1e-14:
            break
    return math.exp(log_front) * fraction / a
