#!/usr/bin/env python3
"""Several trackers in one nodelet manager don't disturb each other.

Parameters: ~bag. In /manager: /one and /twin (the same settings), /rival (another matcher) on one
camera, /other on another.
"""

import subprocess
import sys
import unittest

import rospy
import rostest
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_srvs.srv import Trigger

from active_matching_slam.msg import MatchingStatistics, TrackingState
from active_matching_slam.srv import SetMatcher
import harness

TRACKERS = ('/one', '/twin', '/rival')


class SeveralTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.recording = harness.Recording(rospy.get_param('~bag'))
        cls.feeder = harness.Feeder('/one')
        cls.states = {name: harness.Inbox(name + '/state', TrackingState) for name in TRACKERS}
        harness.wait_until(lambda: all(inbox.connected() for inbox in cls.states.values()) and
                           cls.feeder.images.get_num_connections() > 0, what='three trackers')
        cls.other = harness.Feeder('/other', '/other_camera/image_raw', '/other_camera/camera_info')
        cls.feeder.calibrate(cls.recording.info)
        cls.other.calibrate(cls.recording.info)
        cls.shift = rospy.Duration(0)

    def setUp(self):
        for name in TRACKERS + ('/other', ):
            self.assertTrue(self.service(name + '/reset', Trigger)().success)
        SeveralTest.shift += rospy.Duration(100)

    def service(self, name, kind):
        rospy.wait_for_service(name, 30)
        return rospy.ServiceProxy(name, kind)

    def inboxes(self, topic, kind):
        inboxes = {name: harness.Inbox(name + topic, kind) for name in TRACKERS}
        for inbox in inboxes.values():
            self.addCleanup(inbox.close)
        harness.wait_until(lambda: all(i.connected() for i in inboxes.values()), what=topic)
        rospy.sleep(0.2)
        return inboxes

    def image(self, index):
        image = self.recording.images[index]
        return harness.image_like(image, image.header.stamp + self.shift)

    def feed(self, index, among=TRACKERS):
        """States of the trackers on the first camera."""
        image = self.image(index)
        self.feeder.feed(image)
        states = {name: self.states[name].wait_for_stamp(image.header.stamp) for name in among}
        self.assertNotIn(None, states.values())
        return states

    def test_each_gives_what_it_gives_alone(self):
        poses = self.inboxes('/pose', PoseWithCovarianceStamped)
        statistics = self.inboxes('/statistics', MatchingStatistics)
        for index in range(40):
            states = self.feed(index)
            self.other.feed(self.image(index))
        for name, state in states.items():
            self.assertEqual(TrackingState.TRACKING, state.state, name)
        stamp = self.image(39).header.stamp
        one, twin = (poses[name].wait_for_stamp(stamp).pose for name in ('/one', '/twin'))
        self.assertEqual(one, twin, 'bit for bit')
        told = [statistics[name].wait_for_stamp(stamp) for name in TRACKERS]
        self.assertEqual(['active', 'active', 'jcbb'], [message.matcher for message in told])
        self.assertEqual(told[0].pixels_searched, told[1].pixels_searched)
        self.assertNotEqual(told[0].pixels_searched, told[2].pixels_searched)

    def test_reset_settings_and_odd_input_of_one_are_its_own(self):
        statistics = self.inboxes('/statistics', MatchingStatistics)
        for index in range(10):
            before = self.feed(index)
        self.assertTrue(self.service('/rival/reset', Trigger)().success)
        self.addCleanup(self.service('/rival/set_matcher', SetMatcher), 'jcbb')
        self.assertTrue(self.service('/rival/set_matcher', SetMatcher)('active_search').success)
        broken = self.image(10)
        broken.data = b'odd'
        self.other.feed(broken, expect_answer=False, timeout_s=0.3)
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
        subprocess.run(['rosrun', 'nodelet', 'nodelet', 'unload', '/rival', '/manager'], check=True)
        harness.wait_until(lambda: not self.states['/rival'].connected(), what='the end of one')
        for index in range(5, 10):
            states = self.feed(index, ('/one', '/twin'))
        self.assertEqual(TrackingState.TRACKING, states['/one'].state)
        again = subprocess.Popen(['rosrun', 'nodelet', 'nodelet', 'load',
                                  'active_matching_slam/TrackerNodelet', '/manager',
                                  '__name:=rival', 'image:=/camera/image_raw'])
        self.addCleanup(again.wait)
        self.addCleanup(again.terminate)
        harness.wait_until(self.states['/rival'].connected, what='the one that is loaded again')
        self.assertTrue(self.service('/rival/reset', Trigger)().success)
        self.feeder.calibrate(self.recording.info)
        states = self.feed(10)
        self.assertEqual(TrackingState.TRACKING, states['/rival'].state)


if __name__ == '__main__':
    rospy.init_node('several_test')
    rostest.rosrun('active_matching_slam', 'several_test', SeveralTest, sys.argv)
