#!/usr/bin/env python3
"""The panel of rviz is used beside a live tracker, on a screen that nobody sees (Xvfb).

Each test of the program panel_clicks is one of these. Skipped, and said so, without Xvfb.
"""

import os
import shutil
import subprocess
import sys
import unittest

import rostest

PACKAGE = 'active_matching_slam'


def program():
    """Of the devel space that is sourced."""
    for prefix in os.environ['CMAKE_PREFIX_PATH'].split(os.pathsep):
        path = os.path.join(prefix, 'lib', PACKAGE, 'panel_clicks')
        if os.access(path, os.X_OK):
            return path
    raise AssertionError('panel_clicks was not built')


class PanelTest(unittest.TestCase):

    def setUp(self):
        if not shutil.which('Xvfb'):
            self.skipTest('no Xvfb: the panel was not tried (apt-get install xvfb)')
        read, write = os.pipe()
        self.screen = subprocess.Popen(
            ['Xvfb', '-displayfd', str(write), '-screen', '0', '1280x1024x24', '-nolisten', 'tcp'],
            pass_fds=[write], stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as number:
            self.display = ':' + number.readline().strip()
        self.addCleanup(self.screen.wait)
        self.addCleanup(self.screen.terminate)

    def test_the_panel_beside_a_live_tracker(self):
        environment = dict(os.environ, DISPLAY=self.display, QT_X11_NO_MITSHM='1')
        run = subprocess.run([program()], env=environment, stdout=subprocess.PIPE,
                             stderr=subprocess.STDOUT, universal_newlines=True)
        print(run.stdout)
        self.assertEqual(0, run.returncode, run.stdout[-3000:])


if __name__ == '__main__':
    rostest.rosrun(PACKAGE, 'rviz_panel_test', PanelTest, sys.argv)
