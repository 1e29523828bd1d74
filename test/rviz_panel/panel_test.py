#!/usr/bin/env python3
"""The panel of rviz is used beside a live tracker, on a screen that nobody sees (Xvfb).

Each test of the program panel_clicks is one of these. Skipped, and said so, without Xvfb.
Parameters: ~bag. Node under test: /tracker.
"""

import os
import shutil
import subprocess
import sys
import threading
import unittest

import rospy
import rostest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, 'ros'))
import harness  # noqa: E402

PACKAGE = 'active_matching_slam'


def program():
    """Of the devel space that is sourced."""
    for prefix in os.environ['CMAKE_PREFIX_PATH'].split(os.pathsep):
        path = os.path.join(prefix, 'lib', PACKAGE, 'panel_clicks')
        if os.access(path, os.X_OK):
            return path
    raise AssertionError('panel_clicks was not built')


class EndlessFilm:
    """Feeds a tracker a film to and fro, its stamps always later: it never begins anew by itself.

    Each image waits for the answer to the one before. End it with stop().
    """

    INTERVAL_S = 1.0 / 30

    def __init__(self, recording, tracker):
        self.recording = recording
        self.feeder = harness.Feeder([tracker])
        self.feeder.calibrate(recording.info)
        self.states, self.fault = [], None
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        try:
            last = len(self.recording.images) - 1
            at, step = 0, 1
            stamp = self.recording.images[0].header.stamp
            while not self._ends.wait(self.INTERVAL_S):
                image = harness.image_like(self.recording.images[at], stamp)
                self.states.append(self.feeder.feed(image))
                if not 0 <= at + step <= last:
                    step = -step
                at += step
                stamp += rospy.Duration(self.INTERVAL_S)
        except Exception as error:  # told by the test
            self.fault = error

    def stop(self):
        self._ends.set()
        self._thread.join()


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
        film = EndlessFilm(harness.Recording(rospy.get_param('~bag')), '/tracker')
        self.addCleanup(film.stop)
        environment = dict(os.environ, DISPLAY=self.display, QT_X11_NO_MITSHM='1')
        run = subprocess.run([program()], env=environment, stdout=subprocess.PIPE,
                             stderr=subprocess.STDOUT, universal_newlines=True)
        print(run.stdout)
        self.assertIsNone(film.fault)
        self.assertEqual(0, run.returncode, run.stdout[-3000:])


if __name__ == '__main__':
    rospy.init_node('panel_test')
    rostest.rosrun(PACKAGE, 'rviz_panel_test', PanelTest, sys.argv)
