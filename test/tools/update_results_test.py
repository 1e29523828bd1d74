#!/usr/bin/env python3
"""scripts/update_results: the page it makes of a folder with one short recording.

AMS_PROGRAMS: where the built programs are.
"""

import importlib.machinery
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import rosbag

SCRIPTS = Path(__file__).resolve().parents[2] / 'scripts'
PROGRAMS = Path(os.environ['AMS_PROGRAMS'])
sys.dont_write_bytecode = True


def load_script():
    loader = importlib.machinery.SourceFileLoader('update_results',
                                                  str(SCRIPTS / 'update_results'))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


def make_recording(folder):
    """A rendered second and a half, as recordings are kept: frames/, times, calibration, truth."""
    frames = folder / 'frames'
    frames.mkdir(parents=True)
    film = folder.parent / 'film.bag'
    subprocess.run([str(PROGRAMS / 'simulate_bag'), '--size', '320x240', '--seconds', '1.5',
                    '--output', str(film)], check=True, stdout=subprocess.DEVNULL)
    stamps = []
    with rosbag.Bag(str(film)) as bag:
        for _, message, _ in bag.read_messages(topics=['/camera/image_raw']):
            header = 'P5 {} {} 255\n'.format(message.width, message.height).encode()
            (frames / '{:04d}.pgm'.format(len(stamps))).write_bytes(header + bytes(message.data))
            stamps.append('%.9f' % message.header.stamp.to_sec())
    (folder / 'times.txt').write_text('\n'.join(stamps) + '\n')
    shutil.copy(str(film.with_suffix('.camera.yaml')), str(folder / 'camera.yaml'))
    shutil.copy(str(film.with_suffix('.groundtruth.txt')), str(folder / 'groundtruth.txt'))
    return len(stamps)


class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = Path(tempfile.mkdtemp(prefix='ams_results_'))

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(str(cls.folder))

    def run_script(self, *arguments):
        return subprocess.run([str(SCRIPTS / 'update_results'), *map(str, arguments)],
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              universal_newlines=True, timeout=300)

    def test_has_a_row_for_each_recording_matcher_and_rate(self):
        frames = make_recording(self.folder / 'all' / 'corner_of_a_room')
        (self.folder / 'all' / 'torn').mkdir()
        (self.folder / 'all' / 'torn' / 'times.txt').write_text('0.0\n')
        page = self.folder / 'doc' / 'results.md'
        done = self.run_script(self.folder / 'all', '--matchers', 'active,jcbb', '--every', '2',
                               '--output', page)
        # The one that can't be read is named, and does not keep the other from being tracked.
        self.assertEqual(1, done.returncode)
        self.assertRegex(done.stderr, 'update_results: torn: .')
        text = page.read_text(encoding='utf-8')
        for matcher in ('active', 'jcbb'):
            row = re.search(r'\| corner_of_a_room \| %s \| (\d+) of (\d+) \| 0 \| ([\d.]+) \|'
                            % matcher, text)
            self.assertIsNotNone(row, text)
            self.assertEqual((frames, frames), (int(row.group(1)), int(row.group(2))))
            self.assertLess(float(row.group(3)), 100.0)  # mm, of a path of decimetres
        self.assertIn('| recording | every | active | jcbb |', text)
        self.assertRegex(text, r'\| corner_of_a_room \| 2 \| [\d.]+ \| [\d.]+ \|')
        self.assertTrue((page.parent / 'images/results/corner_of_a_room.png').exists())

    def test_a_folder_without_recordings_is_named(self):
        empty = self.folder / 'empty'
        empty.mkdir()
        done = self.run_script(empty, '--output', self.folder / 'none.md')
        self.assertNotEqual(0, done.returncode)
        self.assertIn(str(empty), done.stderr)
        self.assertFalse((self.folder / 'none.md').exists())

    def test_frames_that_were_not_tracked_are_told_beside_the_error(self):
        brief = load_script().brief
        summary = {'ate_sim3_m': 0.0123, 'frames_tracked': 10, 'frames': 10}
        self.assertEqual('12.30', brief(summary))
        self.assertEqual('12.30 (9 of 10)', brief(dict(summary, frames_tracked=9)))
        self.assertEqual('- (0 of 10)', brief(dict(summary, ate_sim3_m=None, frames_tracked=0)))


if __name__ == '__main__':
    unittest.main()
