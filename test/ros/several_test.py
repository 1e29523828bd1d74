#!/usr/bin/env python3
"""Several trackers in one nodelet manager don't disturb each other.

Parameters: ~bag. In /driver/manager: /one and /twin (the same settings), /rival (another matcher) on one
camera, /other on another.
"""

import signal
import subprocess
import sys

import rospy
import rostest
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_srvs.srv import Trigger

from active_matching_slam.msg import MatchingStatistics, TrackingState
from active_matching_slam.srv import SetMatcher
import harness

class SeveralTest(harness.TrackerTestCase):

    trackers = ('/one', '/twin', '/rival')

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.other = harness.Feeder(['/other'], '/other_camera/image_raw',
                                   '/other_camera/camera_info')
        cls.other.calibrate(cls.recording.info)

    def start_anew(self):
        super().start_anew()
        self.assertTrue(self.service('reset', Trigger, '/other')().success)

    def inboxes(self, topic, kind):
        return {name: self.inbox(topic, kind, name) for name in self.trackers}

    def feed(self, index):
        """States of the trackers on the first camera."""
        return self.feeder.feed_all(self.image(index))

    def test_each_gives_what_it_gives_alone(self):
        poses = self.inboxes('pose', PoseWithCovarianceStamped)
        statistics = self.inboxes('statistics', MatchingStatistics)
        for index in range(40):
            states = self.feed(index)
            self.other.feed(self.image(index))
        for name, state in states.items():
            self.assertEqual(TrackingState.TRACKING, state.state, name)
        stamp = self.image(39).header.stamp
        one, twin = (poses[name].wait_for_stamp(stamp).pose for name in ('/one', '/twin'))
        self.assertEqual(one, twin, 'bit for bit')
        received = [statistics[name].wait_for_stamp(stamp) for name in self.trackers]
        self.assertEqual(['active', 'active', 'jcbb'], [message.matcher for message in received])
        self.assertEqual(received[0].pixels_searched, received[1].pixels_searched)
        self.assertNotEqual(received[0].pixels_searched, received[2].pixels_searched)

    def test_reset_settings_and_odd_input_of_one_are_its_own(self):
        statistics = self.inboxes('statistics', MatchingStatistics)
        for index in range(10):
            before = self.feed(index)
        self.assertTrue(self.service('reset', Trigger, '/rival')().success)
        set_matcher = self.service('set_matcher', SetMatcher, '/rival')
        self.addCleanup(set_matcher, 'jcbb')
        self.assertTrue(set_matcher('active_search').success)
        broken = self.image(10)
        broken.data = b'odd'
        self.assertIsNone(self.other.feed_in_vain(broken))
        after = self.feed(10)
        self.assertEqual(before['/rival'].resets + 1, after['/rival'].resets)
        self.assertEqual(before['/one'].resets, after['/one'].resets)
        self.feed(11)
        stamp = self.image(11).header.stamp
        self.assertEqual('active_search', statistics['/rival'].wait_for_stamp(stamp).matcher)
        self.assertEqual('active', statistics['/one'].wait_for_stamp(stamp).matcher)

    def test_one_that_is_unloaded_leaves_the_others(self):
        for index in range(5):
            self.feed(index)
        subprocess.run(['rosrun', 'nodelet', 'nodelet', 'unload', '/rival', '/driver/manager'], check=True)
        rival = self.feeder.states.pop('/rival')
        harness.wait_until(lambda: not rival.connected(), what='the end of one')
        for index in range(5, 10):
            states = self.feed(index)
        self.assertEqual(TrackingState.TRACKING, states['/one'].state)
        again = subprocess.Popen(['rosrun', 'nodelet', 'nodelet', 'load',
                                  'active_matching_slam/TrackerNodelet', '/driver/manager',
                                  '__name:=rival', 'image:=/camera/image_raw'])
        self.addClassCleanup(again.wait)  # unloads it when it ends
        self.addClassCleanup(again.send_signal, signal.SIGINT)
        harness.node_of('/rival')
        harness.wait_until(rival.connected, what='the one that is loaded again')
        self.feeder.states['/rival'] = rival
        self.feeder.calibrate(self.recording.info)
        states = self.feed(10)
        self.assertEqual(TrackingState.TRACKING, states['/rival'].state)


if __name__ == '__main__':
    rospy.init_node('several_test')
    rostest.rosrun('active_matching_slam', 'several_test', SeveralTest, sys.argv)
