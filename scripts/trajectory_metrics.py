"""Numbers about trajectories: association, alignment, consistency. Used by compare_runs."""

import numpy as np

ASSOCIATION_S = 0.02  # largest difference of stamps of the same moment


def associate(stamps, true_stamps, most_s=ASSOCIATION_S):
    """Indices into both of the pairs that are each other's nearest, at most so far apart."""
    if not len(stamps) or not len(true_stamps):
        return np.zeros(0, int), np.zeros(0, int)

    def nearest(of, to):
        after = np.clip(np.searchsorted(to, of), 1, max(1, len(to) - 1))
        before = after - 1
        after = np.minimum(after, len(to) - 1)
        return np.where(of - to[before] <= to[after] - of, before, after)

    truth = nearest(stamps, true_stamps)
    mutual = nearest(true_stamps, stamps)[truth] == np.arange(len(stamps))
    kept = mutual & (np.abs(true_stamps[truth] - stamps) <= most_s)
    return np.flatnonzero(kept), truth[kept]


def align_sim3(points, truth):
    """scale, R, t with truth ~ scale R points + t (Umeyama 1991). Both n x 3."""
    mean_points, mean_truth = points.mean(axis=0), truth.mean(axis=0)
    centred = points - mean_points
    U, singular, Vt = np.linalg.svd((truth - mean_truth).T @ centred)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = (U * sign) @ Vt
    scale = singular @ sign / np.sum(centred**2)
    return scale, R, mean_truth - scale * R @ mean_points


def multiply(a, b):
    """Products of quaternions x y z w, row by row."""
    va, wa, vb, wb = a[..., :3], a[..., 3:], b[..., :3], b[..., 3:]
    return np.concatenate([wa * vb + wb * va + np.cross(va, vb),
                           wa * wb - np.sum(va * vb, axis=-1, keepdims=True)], axis=-1)


def conjugate(q):
    return q * [-1, -1, -1, 1]


def rotate(q, points):
    pure = np.concatenate([points, np.zeros_like(points[..., :1])], axis=-1)
    return multiply(multiply(q, pure), conjugate(q))[..., :3]


def rotation_vector(q):
    q = np.where(q[..., 3:] < 0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    return q[..., :3] * 2 * np.arctan2(sine, q[..., 3:]) / np.maximum(sine, 1e-300)


def pose_nees(poses, covariances, truth):
    """e' P^-1 e of each pose; NaN where P is not positive definite. Poses are x y z qx qy qz qw of
    camera in world, covariances n x 6 x 6: of the position, then of the world-frame rotation vector
    (evaluation/consistency.h). The map's world is that of its first camera, which is known without
    error; its unit of length is a convention: the likeliest one."""
    to_map = multiply(poses[0, 3:], conjugate(truth[0, 3:]))
    position = poses[:, :3] - poses[0, :3]
    true_position = rotate(to_map, truth[:, :3] - truth[0, :3])
    rotation = rotation_vector(multiply(multiply(to_map, truth[:, 3:]), conjugate(poses[:, 3:])))
    known = np.full(len(poses), False)
    for i, P in enumerate(covariances):
        try:
            np.linalg.cholesky(P)
            known[i] = True
        except np.linalg.LinAlgError:
            pass
    nees = np.full(len(poses), np.nan)
    d = np.hstack([-position, rotation])[known]  # the error is d + unit t
    t = np.hstack([true_position, np.zeros_like(rotation)])[known]
    W = np.linalg.inv(covariances[known])
    information = np.einsum('ni,nij,nj', t, W, t)
    unit = -np.einsum('ni,nij,nj', d, W, t) / information if information > 0 else 1.0
    e = d + (unit if unit > 0 else 1.0) * t
    nees[known] = np.einsum('ni,nij,nj->n', e, W, e)
    return nees


def chi_square_mean_bounds(degrees, runs, confidence=0.95):
    """Two-sided, of the mean over `runs` values of a chi-square variable. `degrees` is even."""
    half = degrees * runs // 2
    log_factorial = np.cumsum(np.log(np.maximum(1, np.arange(half))))

    def distribution(x):  # of the sum: the tail of a Poisson distribution
        k = np.arange(half)
        return 1 - np.sum(np.exp(k * np.log(x / 2) - x / 2 - log_factorial))

    def quantile(probability):
        low, high = 1e-9, 20.0 * degrees * runs
        for _ in range(200):
            middle = (low + high) / 2
            low, high = (middle, high) if distribution(middle) < probability else (low, middle)
        return low

    tail = (1 - confidence) / 2
    return quantile(tail) / runs, quantile(1 - tail) / runs


def geometric_mean(values):
    values = np.array([v for v in values if v is not None and np.isfinite(v) and v > 0])
    return float(np.exp(np.mean(np.log(values)))) if len(values) else np.nan


def quantile(values, share):
    return float(np.quantile(values, share)) if len(values) else None
