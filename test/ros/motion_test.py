#!/usr/bin/env python3
"""Odometry and IMU beside the images: used, late, missing, jumping, in the wrong frame, by the wrong
clock.

Parameters: ~bag. Nodes under test: /wheeled (odometry on /wheels) and /flown (IMU on /flight/imu).
"""

import math
import sys
import threading

import numpy as np
import rospy
import rostest
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import Imu

from active_matching_slam.msg import TrackingState
import harness

# The camera in the base: looks forward, 0.1 m ahead and 0.3 m up. Columns: the optical axes.
T_BASE_CAMERA = np.array([[0.0, 0.0, 1.0, 0.1], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.3],
                          [0.0, 0.0, 0.0, 1.0]])


def quaternion_of(m):
    """x y z w of a rotation, the largest component first found, so that none is divided by."""
    k = [m[0, 0], m[1, 1], m[2, 2], np.trace(m[:3, :3])].index(
        max(m[0, 0], m[1, 1], m[2, 2], np.trace(m[:3, :3])))
    if k == 3:
        q = [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1 + np.trace(m[:3, :3])]
    else:
        i, j, l = k, (k + 1) % 3, (k + 2) % 3
        q = [0.0] * 4
        q[i] = 1 + m[i, i] - m[j, j] - m[l, l]
        q[j] = m[j, i] + m[i, j]
        q[l] = m[l, i] + m[i, l]
        q[3] = m[l, j] - m[j, l]
    return np.array(q) / np.linalg.norm(q)


class MotionTest(harness.TrackerTestCase):

    trackers = ('/wheeled', '/flown')

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.log = harness.Inbox('/rosout', Log)
        cls.wheels = harness.publisher('/wheels', Odometry)
        cls.flight = harness.publisher('/flight/imu', Imu)
        cls.fixed = tf2_ros.StaticTransformBroadcaster()
        nodes = set(cls.trackers)
        harness.wait_until(lambda: nodes <= harness.listeners(cls.fixed.pub_tf) and
                           '/wheeled' in harness.listeners(cls.wheels) and
                           '/flown' in harness.listeners(cls.flight), what='listeners')
        transform = TransformStamped()
        transform.header.frame_id = 'base_link'
        transform.child_frame_id = cls.images[0].header.frame_id
        p, r = transform.transform.translation, transform.transform.rotation
        p.x, p.y, p.z = T_BASE_CAMERA[:3, 3]
        r.x, r.y, r.z, r.w = quaternion_of(T_BASE_CAMERA)
        cls.fixed.sendTransform(transform)
        for node in cls.trackers:
            harness.settle(node)

    def base(self, index):
        """T_world_base of an image."""
        return self.recording.truth[self.images[index].header.stamp].dot(
            np.linalg.inv(T_BASE_CAMERA))

    def say(self, index, frame='base_link', shift=rospy.Duration(0), move=0.0, variance=1e-4):
        """What odometry and IMU say at the time of an image."""
        stamp = self.image(index).header.stamp + shift
        odometry = Odometry()
        odometry.header.stamp, odometry.header.frame_id = stamp, 'odom'
        odometry.child_frame_id = frame
        matrix = self.base(index)
        p, q = odometry.pose.pose.position, odometry.pose.pose.orientation
        p.x, p.y, p.z = matrix[:3, 3]
        p.x += move
        odometry.twist.covariance = [variance if i % 7 == 0 else 0.0 for i in range(36)]
        q.x, q.y, q.z, q.w = quaternion_of(matrix)
        self.wheels.publish(odometry)
        imu = Imu()
        imu.header.stamp, imu.header.frame_id = stamp, frame
        before, after = self.base(max(0, index - 1)), self.base(index + 1)
        seconds = (self.images[index + 1].header.stamp -
                   self.images[max(0, index - 1)].header.stamp).to_sec()
        turn = before[:3, :3].T.dot(after[:3, :3])
        rate = imu.angular_velocity
        rate.x, rate.y, rate.z = [(turn[2, 1] - turn[1, 2]) / (2 * seconds),
                                  (turn[0, 2] - turn[2, 0]) / (2 * seconds),
                                  (turn[1, 0] - turn[0, 1]) / (2 * seconds)]
        self.flight.publish(imu)

    def feed(self, index, **what):
        """Both trackers' states after the image, which is said before."""
        self.say(index, **what)
        for node in self.trackers:
            harness.settle(node)
        return self.feeder.feed_all(self.image(index))

    def run_with_motion(self, first, last):
        states = None
        for index in range(first, last):
            states = self.feed(index)
        return states

    def assert_used(self, states):
        self.assertEqual('odometry', states['/wheeled'].motion_source,
                         states['/wheeled'].motion_fault)
        self.assertEqual('gyro', states['/flown'].motion_source, states['/flown'].motion_fault)

    def assert_said_once(self, node, topic):
        said = [m.msg for m in self.log.messages if m.name == node and topic in m.msg]
        self.assertEqual(1, len(said), said)

    def warning(self, node, text):
        return self.log.wait_for(lambda m: m.name == node and m.level >= Log.WARN and text in m.msg)

    def test_odometry_makes_the_map_metric_and_an_imu_is_used(self):
        last = len(self.images) - 1
        states = self.run_with_motion(0, last)
        self.assert_used(states)
        for state in states.values():
            self.assertEqual(TrackingState.TRACKING, state.state, state.reason)
        wheeled = states['/wheeled']
        self.assertEqual(TrackingState.SCALE_ODOMETRY, wheeled.scale_source)
        self.assertEqual('odometry', wheeled.scale_source_name)
        self.assertTrue(0.0 < wheeled.scale_sigma < 0.1, wheeled.scale_sigma)
        self.assertEqual(TrackingState.SCALE_FREE, states['/flown'].scale_source)

    def test_what_is_missing_is_named_by_its_topic_and_used_again_when_it_comes(self):
        self.assert_used(self.run_with_motion(0, 8))
        self.log.clear()
        for index in range(8, 50):  # longer than the timeout, by their stamps
            states = self.feeder.feed_all(self.image(index))
        for node, topic in (('/wheeled', '/wheels'), ('/flown', '/flight/imu')):
            self.assertEqual('', states[node].motion_source)
            self.assertNotEqual('', states[node].motion_fault)
            self.assertEqual(TrackingState.TRACKING, states[node].state, states[node].reason)
            warning = self.warning(node, topic)
            self.assertIsNotNone(warning)
            self.assertIn('constant velocity', warning.msg)
            self.assert_said_once(node, topic)
        diagnostics = self.inbox('/diagnostics', DiagnosticArray)
        for topic in ('/wheels', '/flight/imu'):
            self.assertIsNotNone(diagnostics.wait_for(lambda m: any(
                topic in s.message for s in m.status)))
        self.assert_used(self.run_with_motion(50, 54))

    def test_what_comes_late_is_waited_for(self):
        self.run_with_motion(0, 5)
        for index in range(5, 8):
            image = self.image(index)
            for inbox in self.feeder.states.values():
                inbox.clear()
            self.feeder.images.publish(image)
            threading.Event().wait(0.1)
            self.say(index)
            states = {node: inbox.wait_for_stamp(image.header.stamp)
                      for node, inbox in self.feeder.states.items()}
        self.assert_used(states)

    def test_a_wrong_frame_is_named(self):
        self.run_with_motion(0, 5)
        self.log.clear()
        for index in range(5, 8):
            states = self.feed(index, frame='nowhere')
        for node in self.trackers:
            self.assertEqual('', states[node].motion_source)
            warning = self.warning(node, 'nowhere')
            self.assertIsNotNone(warning)
            self.assertIn(self.images[0].header.frame_id, warning.msg)
        self.assert_used(self.run_with_motion(8, 12))

    def test_another_clock_is_named(self):
        self.assert_used(self.run_with_motion(0, 5))
        self.log.clear()
        for index in range(5, 11):
            states = self.feed(index, shift=rospy.Duration(500))
        for node in self.trackers:
            self.assertEqual('', states[node].motion_source)
            self.assertIsNotNone(self.warning(node, 'clock'))

    def test_stamps_that_jump_back_are_named_and_begun_from_anew(self):
        self.run_with_motion(0, 5)
        self.log.clear()
        self.say(5, shift=rospy.Duration(-100))
        self.feeder.feed_all(self.image(5))
        for node in self.trackers:
            self.assertIsNotNone(self.warning(node, 'ran back'))
        self.assert_used(self.run_with_motion(6, 10))

    def test_odometry_that_jumps_is_taken_for_slip(self):
        last = len(self.images) - 5
        before = self.run_with_motion(0, last)['/wheeled']
        self.assertEqual(TrackingState.SCALE_ODOMETRY, before.scale_source)
        states = self.feed(last, move=3.0)
        self.assertIn('slip', states['/wheeled'].motion_fault)
        states = self.feed(last + 1, move=3.0)
        self.assertEqual('', states['/wheeled'].motion_fault)
        self.assertEqual(TrackingState.TRACKING, states['/wheeled'].state)
        self.assertLess(abs(states['/wheeled'].scale_sigma - before.scale_sigma), 0.01)

    def test_a_covariance_that_is_none_is_named_once_and_the_rest_of_the_message_used(self):
        self.run_with_motion(0, 5)
        self.log.clear()
        for index in range(5, 9):
            states = self.feed(index, variance=-1.0)
        self.assertEqual('odometry', states['/wheeled'].motion_source)
        self.assertIn('covariance', states['/wheeled'].motion_fault)
        self.assertIsNotNone(self.warning('/wheeled', 'covariance'))
        self.assert_said_once('/wheeled', '/wheels')

    def test_a_pose_that_is_none_is_named_once_and_left_out(self):
        self.run_with_motion(0, 5)
        self.log.clear()
        for index in range(5, 9):
            states = self.feed(index, move=math.nan)
        self.assertIn('pose is none', states['/wheeled'].motion_fault)
        self.assertIsNotNone(self.warning('/wheeled', 'pose is none'))
        self.assert_said_once('/wheeled', '/wheels')
        self.assert_used(self.run_with_motion(9, 12))

    def test_a_wrong_frame_is_named_also_where_nothing_came_at_first(self):
        for index in range(3):
            self.feeder.feed_all(self.image(index))
        self.log.clear()
        for index in range(3, 6):
            states = self.feed(index, frame='nowhere')
        for node in self.trackers:
            self.assertIn('nowhere', states[node].motion_fault)
            self.assertIsNotNone(self.warning(node, 'nowhere'))
        diagnostics = self.inbox('/diagnostics', DiagnosticArray)
        for _ in self.trackers:
            self.assertIsNotNone(diagnostics.wait_for(lambda m: any(
                'nowhere' in s.message for s in m.status)))

    def test_an_imu_without_a_gyroscope_is_named(self):
        self.run_with_motion(0, 3)
        self.log.clear()
        imu = Imu()
        imu.header.stamp, imu.header.frame_id = self.image(3).header.stamp, 'base_link'
        imu.angular_velocity_covariance[0] = -1.0
        self.flight.publish(imu)
        harness.settle('/flown')
        self.feeder.feed_all(self.image(3))
        self.assertIsNotNone(self.warning('/flown', 'no gyroscope'))


if __name__ == '__main__':
    rospy.init_node('motion_test')
    rostest.rosrun('active_matching_slam', 'motion_test', MotionTest, sys.argv)
