"""What two builds made of the same bags, as tables. Used by compare_runs."""

import csv
import json

import numpy as np

from trajectory_metrics import (align_sim3, associate, chi_square_mean_bounds, geometric_mean,
                                pose_nees, quantile)

POSE_DEGREES = 6  # of freedom

# From this frame on the truth of the recording is not that of the room, so the frames before have a
# row of their own, which stands for the recording in the means.
TRUE_UNTIL_FRAME = {'uzh_vamr_checkerboard': 366}  # a hand moves the board that the truth is of
# The truth errs by more than the filter: its recording is left out of the mean of e/sigma.
COARSE_TRUTH = {'sevenscenes_redkitchen'}


class Failure(Exception):
    """A run, or the making of its bag, that failed: why, in a line."""


class Run:
    """The results of one build on one case, of its first `frames` images where that is given;
    errors are those of the frames tracked, or of those of them in `among`."""

    def __init__(self, folder, case, frames=None, among=None):
        with open(str(folder / 'statistics.csv'), newline='') as file:
            rows = list(csv.DictReader(file))[:frames]
        summary = json.loads((folder / 'summary.json').read_text())
        self.frames = len(rows)
        self.tracked = np.array([i for i, row in enumerate(rows) if row['state'] == 'tracking'],
                                int)
        self.lost = int(rows[-1]['times_lost']) if rows else 0
        self.ms = np.array([float(row['total_ms']) for row in rows])
        self.ate_m = self.ate_of_path = self.closing = None
        self.ratios, self.nees = np.zeros(0), np.full(self.frames, np.nan)
        if case.truth is None:
            if summary['excursion'] > 0:
                self.closing = summary['displacement'] / summary['excursion']
            return
        asked = np.flatnonzero(np.isin(self.tracked, self.tracked if among is None else among))
        poses = np.load(str(folder / 'poses.npy'))[asked]
        truth = np.loadtxt(str(case.truth), ndmin=2)
        mine, its = associate(poses[:, 0], truth[:, 0])
        if len(mine) < 3:
            return
        pose, true = poses[mine, 1:8], truth[its, 1:8]
        covariance = poses[mine, 8:].reshape(-1, 6, 6)
        scale, R, t = align_sim3(pose[:, :3], true[:, :3])
        error_m = np.linalg.norm(true[:, :3] - (scale * pose[:, :3] @ R.T + t), axis=1)
        sigma_m = scale * np.sqrt(np.trace(covariance[:, :3, :3], axis1=1, axis2=2))
        self.ate_m = float(np.sqrt(np.mean(error_m**2)))
        self.ratios = error_m[sigma_m > 0] / sigma_m[sigma_m > 0]
        if case.is_film:
            path_m = np.sum(np.linalg.norm(np.diff(truth[:, 1:4], axis=0), axis=1))
            self.ate_of_path = self.ate_m / path_m if path_m > 0 else None
            self.nees[self.tracked[asked[mine]]] = pose_nees(pose, covariance, true)

    def numbers(self):
        """For the CSV file."""
        mean_nees = np.nanmean(self.nees) if np.isfinite(self.nees).any() else None
        return {'frames': self.frames, 'tracked': len(self.tracked), 'lost': self.lost,
                'ate_m': self.ate_m, 'ate_of_path': self.ate_of_path, 'closing': self.closing,
                'e_sigma_median': quantile(self.ratios, .5),
                'e_sigma_p90': quantile(self.ratios, .9), 'nees': mean_nees,
                'ms_median': quantile(self.ms, .5), 'ms_p99': quantile(self.ms, .99)}


def nees_of(runs):
    """Mean over runs and time, and the fraction of time within the bounds for so many runs."""
    values = np.full((len(runs), max(len(run.nees) for run in runs)), np.nan)
    for row, run in zip(values, runs):
        row[:len(run.nees)] = run.nees
    values = values[:, np.isfinite(values).any(axis=0)]
    if not values.size:
        return None, None
    mean = np.nanmean(values, axis=0)
    lower, upper = chi_square_mean_bounds(POSE_DEGREES, len(runs))
    return float(np.mean(mean)), float(np.mean((lower <= mean) & (mean <= upper)))


def cells_of(runs):
    """The cells of a row of the table, for one build."""
    def number(value, form, factor=1.0):
        return '' if value is None or not np.isfinite(value) else form % (factor * value)

    nees, within = nees_of(runs)
    ratios, ms = (np.concatenate([getattr(run, name) for run in runs]) for name in ('ratios', 'ms'))
    closing = geometric_mean([run.closing for run in runs])
    return [
        '%d of %d' % (sum(len(run.tracked) for run in runs), sum(run.frames for run in runs)),
        '%d' % sum(run.lost for run in runs),
        number(geometric_mean([run.ate_m for run in runs]), '%.3g', 1e3),
        number(geometric_mean([run.ate_of_path for run in runs]), '%.3g', 1e2)
        or number(closing, 'ends %.2g off', 1e2),
        number(quantile(ratios, .5), '%.2f'), number(quantile(ratios, .9), '%.2f'),
        number(nees, '%.2f'), number(within, '%.0f', 1e2),
        number(quantile(ms, .5), '%.1f'), number(quantile(ms, .99), '%.1f')]


COLUMNS = ['', 'tracked', 'lost', 'ATE mm', 'ATE % of path', 'e/sigma', '90 %', 'NEES', 'within %',
           'ms', '99 %']


def table(rows):
    """Markdown. Rows: (name, runs of OLD, runs of NEW), of the same cases."""
    lines = ['| ' + ' | '.join(COLUMNS) + ' |', '|---' * len(COLUMNS) + '|']
    for name, old, new in rows:
        if not old:
            lines.append('| %s | failed |' % name + ' |' * (len(COLUMNS) - 2))
            continue
        cells = [a if a == b else '%s → %s' % (a or '-', b or '-')
                 for a, b in zip(cells_of(old), cells_of(new))]
        lines.append('| ' + ' | '.join([name] + cells) + ' |')
    return lines


def ratios_of(pairs):
    """Geometric means of NEW / OLD: ATE, e/sigma, ms median, ms 99 %. Pairs: (row, run of OLD, run
    of NEW); each row counts the same, however many runs it has."""
    def ratio(value, without=()):
        of_row = {}
        for row, old, new in pairs:
            a, b = value(old), value(new)
            if a and b and row not in without:
                of_row.setdefault(row, []).append(b / a)
        return geometric_mean([geometric_mean(ratios) for ratios in of_row.values()])

    return [ratio(lambda run: run.ate_m), ratio(lambda run: quantile(run.ratios, .5), COARSE_TRUTH),
            ratio(lambda run: quantile(run.ms, .5)), ratio(lambda run: quantile(run.ms, .99))]


def rows_of(case, every):
    """(name, frames of it or None for all) of the rows of the table that a case belongs to. The
    last stands for it in the means."""
    rows = [(case.row, None)]
    if case.row in TRUE_UNTIL_FRAME:
        until = TRUE_UNTIL_FRAME[case.row]
        rows.append(('%s, frames 0 to %d' % (case.row, until - 1), -(-until // every)))
    return rows


def report(results, builds, every=1):
    """The whole page, as lines, and whether all went well. Results: (case, folder or Failure of
    OLD, the same of NEW), of every `every`-th image."""
    rows, counted, failures, untracked = {}, [], [], []
    for case, *outcomes in results:
        failed = ['- FAILED: %s, %s: %s' % (case.name, build.folder, outcome)
                  for build, outcome in zip(builds, outcomes) if isinstance(outcome, Failure)]
        failures += failed
        for name, frames in rows_of(case, every):
            old, new = rows.setdefault(name, ([], []))
            if failed:
                continue
            runs = [Run(folder, case, frames) for folder in outcomes]
            old.append(runs[0])
            new.append(runs[1])
            common = np.intersect1d(runs[0].tracked, runs[1].tracked)
            missing = len(runs[0].tracked) - len(common)
            if missing and not frames:
                untracked.append('%s: %d' % (case.name, missing))
        if not failed:  # errors grow with the way, so they are compared over the same frames
            counted.append((case, *[Run(folder, case, frames, common) for folder in outcomes]))
    lines = table([(name, old, new) for name, (old, new) in rows.items()])
    films = max((len(old) for name, (old, _) in rows.items() if name.startswith('film ')),
                default=0)
    if films:
        lines += ['', 'NEES: 95 %% bounds of the mean over %d films %.2f to %.2f.' %
                  ((films,) + chi_square_mean_bounds(POSE_DEGREES, films))]
    lines += ['', '| geometric means of NEW / OLD | ATE | e/sigma | ms | ms 99 % |',
              '|---|---|---|---|---|']
    for name, kept in (('recordings', [False]), ('films', [True]), ('all', [False, True])):
        pairs = [(case.row, old, new) for case, old, new in counted if case.is_film in kept]
        if pairs:
            lines.append('| %s | ' % name + ' | '.join(
                '' if np.isnan(r) else '%.3f' % r for r in ratios_of(pairs)) + ' |')
    lines += ['', 'Frames that OLD tracked and NEW did not: %s.' %
              (', '.join(untracked) if untracked else 'none')]
    return lines + ([''] + failures if failures else []), not failures


def write_csv(path, results, every=1):
    lines = [{'case': case.name, 'row': row, 'build': build, **Run(outcome, case, frames).numbers()}
             for case, *outcomes in results for row, frames in rows_of(case, every)
             for build, outcome in zip(('old', 'new'), outcomes)
             if not isinstance(outcome, Failure)]
    with open(path, 'w', newline='') as file:
        writer = csv.DictWriter(file, list(lines[0]) if lines else [])
        writer.writeheader()
        writer.writerows(lines)
