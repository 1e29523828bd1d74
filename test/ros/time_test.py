#!/usr/bin/env python3
"""Simulated time that runs, stands still and jumps; stamps that pause, jump and are missing.

Parameters: ~bag. Nodes under test: /tracker, and /waiting, which asks tf for a frame that is not
there. The test is the clock.
"""

import sys
import threading

import rospy
import rostest
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock, Log
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from active_matching_slam.msg import TrackingState
import harness


def wait(seconds):
    """Of real time: rospy's own sleep stands still with the clock."""
    threading.Event().wait(seconds)


class TimeTest(harness.TrackerTestCase):

    trackers = ('/tracker', '/waiting')

    @classmethod
    def setUpClass(cls):
        cls.clock = rospy.Publisher('/clock', Clock, queue_size=10, latch=True)
        cls.set_clock(rospy.Time(1000))
        super().setUpClass()
        cls.log = harness.Inbox('/rosout', Log)

    def setUp(self):
        super().setUp()
        self.start = rospy.Time(1000) + self.shift
        self.said_before = len(self.log.messages)

    @classmethod
    def set_clock(cls, time):
        cls.clock.publish(Clock(clock=time))

    def stamp(self, index, offset=0.0):
        return self.start + rospy.Duration(offset + index / 30.0)

    def run_images(self, first, last, offset=0.0):
        """The clock shows the images' stamps, as rosbag play --clock has it."""
        states = []
        for index in range(first, last):
            stamp = self.stamp(index, offset)
            self.set_clock(stamp)
            states.append(self.feeder.feed(harness.image_like(self.images[index], stamp)))
        return states

    def warnings(self, text):
        return [m for m in self.log.messages[self.said_before:]
                if m.name == '/tracker' and text in m.msg]

    # -- simulated time ------------------------------------------------------------------------

    def test_a_clock_that_jumps_back_resets_once_and_says_so_once(self):
        before = self.run_images(0, 20)[-1]
        again = self.run_images(0, 20, offset=-300.0)
        self.assertEqual([before.resets + 1] * 20, [state.resets for state in again])
        self.assertEqual(TrackingState.TRACKING, again[-1].state)
        harness.wait_until(lambda: self.warnings('Time ran back'), what='a warning')
        wait(0.5)
        self.assertEqual(1, len(self.warnings('Time ran back')))

    def test_transforms_go_on_after_a_jump_back(self):
        self.run_images(0, 5)
        self.run_images(0, 5, offset=-500.0)
        transforms = self.inbox('/tf', TFMessage)
        self.run_images(5, 10, offset=-500.0)
        message = transforms.wait_for_stamp(self.stamp(9, -500.0))
        self.assertIsNotNone(message)
        self.assertEqual('world', message.transforms[0].header.frame_id)

    def test_a_clock_that_stands_still_stops_nothing(self):
        diagnostics = self.inbox('/diagnostics', DiagnosticArray)
        odometry = self.inbox('odometry', Odometry, '/waiting')
        poses = self.inbox('pose', PoseWithCovarianceStamped, '/waiting')
        self.set_clock(self.start)
        for index in range(10):  # stamps run on, the clock does not
            stamp = self.stamp(index)
            state = self.feeder.feed(harness.image_like(self.images[index], stamp))
        self.assertEqual(TrackingState.TRACKING, state.state)
        diagnostics.clear()
        self.assertIsNotNone(diagnostics.wait_for(lambda message: True))
        # The one whose transforms are missing has said so, gives its own pose, and answers.
        self.assertIsNotNone(poses.wait_for_stamp(stamp))
        self.assertEqual([], odometry.messages)
        self.assertIsNotNone(self.log.wait_for(
            lambda m: m.name == '/waiting' and 'No transform from base_link' in m.msg))
        self.assertTrue(self.service('reset', Trigger, '/waiting')().success)

    def test_a_transform_that_comes_late_is_waited_for_while_the_clock_stands_still(self):
        odometry = self.inbox('odometry', Odometry, '/waiting')
        broadcaster = tf2_ros.TransformBroadcaster()
        node = harness.node_of('/waiting')
        harness.wait_until(lambda: node in harness.listeners(broadcaster.pub_tf), what='listener')
        self.set_clock(self.start)
        frame = self.images[0].header.frame_id

        def send(stamp):
            transform = TransformStamped()
            transform.header.stamp, transform.header.frame_id = stamp, frame
            transform.child_frame_id = 'base_link'
            transform.transform.rotation.w = 1.0
            broadcaster.sendTransform(transform)

        # Long enough on a busy machine; and from now on there is a robot, so something to wait for.
        settings = Client('/waiting', timeout=harness.PATIENCE_S)
        self.addCleanup(settings.update_configuration,
                        {'tf_timeout_s': rospy.get_param('/waiting/tf_timeout_s')})
        settings.update_configuration({'tf_timeout_s': 5.0})
        send(self.start)
        harness.settle(node)
        for index in range(6):
            stamp = self.stamp(index)
            sender = threading.Timer(0.1, send, [stamp])
            sender.start()
            self.feeder.feed(harness.image_like(self.images[index], stamp))
            self.assertIsNotNone(odometry.wait_for_stamp(stamp), index)
            sender.join()

    # -- stamps --------------------------------------------------------------------------------

    def test_a_jump_forward_is_bridged_in_the_same_map(self):
        resets = self.run_images(0, 30)[-1].resets
        states = self.run_images(30, 60, offset=400.0)
        self.assertEqual(TrackingState.TRACKING, states[-1].state, states[-1].reason)
        self.assertEqual(resets, states[-1].resets)

    def test_a_camera_that_pauses_goes_on_in_the_same_map(self):
        resets = self.run_images(0, 30)[-1].resets
        states = self.run_images(30, 60, offset=2.0)
        self.assertEqual(TrackingState.TRACKING, states[-1].state, states[-1].reason)
        self.assertEqual(resets, states[-1].resets)

    def test_an_image_without_a_stamp_is_left_out_and_named(self):
        self.run_images(0, 5)
        image = harness.image_like(self.images[5], rospy.Time())
        self.assertIsNone(self.feeder.feed_in_vain(image))
        harness.wait_until(lambda: self.warnings('image without a stamp'), what='a warning')
        states = self.run_images(6, 10)
        self.assertEqual(TrackingState.TRACKING, states[-1].state)
        self.assertEqual(states[0].resets, states[-1].resets)


if __name__ == '__main__':
    rospy.init_node('time_test')
    rostest.rosrun('active_matching_slam', 'time_test', TimeTest, sys.argv)
