#!/usr/bin/env python3
"""scripts/compare_runs: its numbers, and two short films tracked by one build against itself.

AMS_PROGRAMS: where the built programs are.
"""

import csv
import importlib.machinery
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from types import SimpleNamespace

import numpy as np

SCRIPTS = Path(__file__).resolve().parents[2] / 'scripts'
SPACE = Path(os.environ['AMS_PROGRAMS']).parents[1]
sys.path.insert(0, str(SCRIPTS))
sys.dont_write_bytecode = True
import trajectory_metrics as metrics  # noqa: E402


def load_script():
    loader = importlib.machinery.SourceFileLoader('compare_runs', str(SCRIPTS / 'compare_runs'))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


compare_runs = load_script()


def random_quaternions(random, count):
    q = random.standard_normal((count, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


class Numbers(unittest.TestCase):
    def setUp(self):
        self.random = np.random.RandomState(1)

    def test_alignment_recovers_a_similarity(self):
        points = self.random.standard_normal((20, 3))
        q = random_quaternions(self.random, 1)
        truth = 2.5 * metrics.rotate(q, points) + [1, 2, 3]
        scale, R, t = metrics.align_sim3(points, truth)
        self.assertAlmostEqual(scale, 2.5)
        np.testing.assert_allclose(scale * points @ R.T + t, truth, atol=1e-12)
        self.assertAlmostEqual(np.linalg.det(R), 1.0)

    def test_association_pairs_nearest_stamps_once(self):
        mine, its = metrics.associate(np.array([0.0, 1.0, 2.0, 9.0]),
                                      np.array([0.01, 0.99, 1.005, 2.5]))
        self.assertEqual([(0, 0), (1, 2)], list(zip(mine, its)))
        self.assertEqual(0, len(metrics.associate(np.zeros(0), np.array([1.0]))[0]))
        self.assertEqual(1, len(metrics.associate(np.array([1.0]), np.array([1.0]))[0]))

    def test_bounds_of_the_mean_are_those_of_tables(self):
        # Chi-square of 60 degrees: 40.482 and 83.298 (2.5 and 97.5 %).
        np.testing.assert_allclose(metrics.chi_square_mean_bounds(6, 10), [4.0482, 8.3298],
                                   rtol=2e-5)

    def test_nees_of_errors_as_the_covariance_says_is_their_chi_square(self):
        count = 2000
        truth = np.hstack([self.random.standard_normal((count, 3)) * 5,
                           random_quaternions(self.random, count)])
        root = self.random.standard_normal((count, 6, 6)) * 1e-3
        covariance = root @ root.transpose(0, 2, 1) + 1e-8 * np.eye(6)
        error = np.einsum('nij,nj->ni', np.linalg.cholesky(covariance),
                          self.random.standard_normal((count, 6)))
        error[0] = 0.0  # the first camera is known
        half = error[:, 3:] / 2
        turn = np.hstack([half, np.sqrt(1 - np.sum(half**2, axis=1, keepdims=True))])
        poses = np.hstack([truth[:, :3] - error[:, :3],
                           metrics.multiply(metrics.conjugate(turn), truth[:, 3:])])
        nees = metrics.pose_nees(poses, covariance, truth)
        self.assertAlmostEqual(np.mean(nees), 6.0, delta=0.3)
        # The same in a world of another unit, place and orientation: those are conventions.
        q = random_quaternions(self.random, 1)
        moved = np.hstack([2 * metrics.rotate(q, truth[:, :3]) + 7,
                           metrics.multiply(q, truth[:, 3:])])
        np.testing.assert_allclose(metrics.pose_nees(poses, covariance, moved), nees, rtol=1e-6,
                                   atol=1e-9)
        self.assertTrue(np.isnan(metrics.pose_nees(poses, 0 * covariance, truth)).all())

    def test_drawn_calibrations_depend_on_the_name_alone(self):
        text = ('camera_matrix:\n  rows: 3\n  cols: 3\n'
                '  data: [500, 0, 320, 0, 500, 240, 0, 0, 1]\ndistortion_model: none\n')
        drawn, focal_px = compare_runs.drawn_calibration(text, 'a film')
        self.assertEqual((drawn, focal_px), compare_runs.drawn_calibration(text, 'a film'))
        self.assertNotEqual(drawn, compare_runs.drawn_calibration(text, 'another')[0])
        focal = [compare_runs.drawn_calibration(text, str(i))[1] for i in range(400)]
        self.assertAlmostEqual(np.std(focal) / 500, 1e-3, delta=1e-4)

    def test_halves_are_the_whole(self):
        whole = list(range(1, 8))
        halves = [compare_runs.half_of(whole, half) for half in ('first', 'second')]
        self.assertEqual(whole, sorted(halves[0] + halves[1]))


class Comparison(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = Path(tempfile.mkdtemp(prefix='ams_compare_'))

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(str(cls.folder))

    def run_script(self, *arguments):
        return subprocess.run(
            [str(SCRIPTS / 'compare_runs'), *map(str, arguments), '--no-recordings',
             '--seconds', '1', '--seeds', '1', '--only', '320x240', '--work', str(self.folder)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, timeout=300)

    def test_a_build_against_itself_is_as_good_as_itself(self):
        done = self.run_script(SPACE, SPACE, '--csv', self.folder / 'runs.csv', '--output',
                               self.folder / 'table.md')
        self.assertEqual(0, done.returncode, done.stderr)
        self.assertEqual(done.stdout, (self.folder / 'table.md').read_text(encoding='utf-8'))
        self.assertIn('| films | 1.000 | 1.000 | 1.000 | 1.000 |', done.stdout)
        self.assertIn('OLD tracked and NEW did not: none', done.stdout)
        for motion in compare_runs.MOTIONS:
            self.assertIn('| film %s 320x240 | ' % motion, done.stdout)
        with open(str(self.folder / 'runs.csv'), newline='') as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(4, len(rows))
        for row in rows:  # what track_bag itself says of the run
            result, = (self.folder / 'results').glob(row['case'] + '_*')
            summary = json.loads((result / 'summary.json').read_text())
            self.assertEqual(summary['frames_tracked'], int(row['tracked']))
            self.assertAlmostEqual(summary['ate_sim3_m'] / float(row['ate_m']), 1.0, places=6)

    def test_a_run_that_fails_is_named_and_the_others_go_on(self):
        done = self.run_script(SPACE, SPACE, '--set-new', 'no_such_option=1')
        self.assertEqual(1, done.returncode)
        self.assertIn('FAILED: film_room_slow_320x240_seed1_1s, ', done.stdout)
        self.assertIn('FAILED: film_room_jerky_320x240_seed1_1s, ', done.stdout)
        self.assertIn('no_such_option', done.stdout)

    def test_a_folder_without_a_build_is_named(self):
        done = self.run_script(SPACE, self.folder)
        self.assertNotEqual(0, done.returncode)
        self.assertIn('%s: has no devel/lib' % self.folder, done.stderr)


class Report(unittest.TestCase):
    def test_frames_that_only_the_old_build_tracked_are_counted(self):
        with tempfile.TemporaryDirectory() as folder:
            outcomes = []
            for name, states in (('old', ['tracking'] * 3), ('new', ['tracking', 'lost', 'lost'])):
                outcome = Path(folder) / name
                outcome.mkdir()
                (outcome / 'statistics.csv').write_text('state,times_lost,total_ms\n' + ''.join(
                    '%s,0,1\n' % state for state in states))
                (outcome / 'summary.json').write_text('{"excursion": 1, "displacement": 0.5}')
                outcomes.append(outcome)
            case = SimpleNamespace(name='a case', row='a row', truth=None, is_film=False)
            lines, fine = compare_runs.report([[case, *outcomes]], [])
        self.assertTrue(fine)
        self.assertIn('| a row | 3 of 3 → 1 of 3 |', '\n'.join(lines))
        self.assertIn('a case: 2', '\n'.join(lines))


if __name__ == '__main__':
    unittest.main(argv=sys.argv, verbosity=2)
