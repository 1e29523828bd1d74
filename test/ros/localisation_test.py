#!/usr/bin/env python3
"""Mapping off: a camera in a map that was saved before, and where it is said to be.

Parameters: ~bag. Nodes under test: /tracker, which makes the map, and /follower (mapping false).
"""

import math
import os
import sys

import numpy as np
import rospy
import rostest
from geometry_msgs.msg import PoseWithCovarianceStamped
from rosgraph_msgs.msg import Log

from active_matching_slam.msg import TrackingState
from active_matching_slam.srv import LoadMap, SaveMap
import harness

MAPPED = 60  # images


class LocalisationTest(harness.TrackerTestCase):

    trackers = ('/tracker', '/follower')

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.log = harness.Inbox('/rosout', Log)

    def map_and_load(self):
        """The map's file; the follower has loaded it."""
        self.run_images(0, MAPPED)
        saved = self.service('save_map', SaveMap)('localisation.map')
        self.assertTrue(saved.success, saved.message)
        self.addCleanup(os.remove, saved.message)
        loaded = self.service('load_map', LoadMap, '/follower')('localisation.map')
        self.assertTrue(loaded.success, loaded.message)
        return saved.message

    def test_the_camera_is_followed_in_a_map_that_stays_as_it_is(self):
        poses = self.inbox('pose', PoseWithCovarianceStamped, '/follower')
        waiting = self.feeder.feed_all(self.image(0))['/follower']
        is_first = waiting.state == TrackingState.WAITING  # of the tests to run: without a map
        if is_first:
            self.assertIn('no map', waiting.reason)
        path = self.map_and_load()
        with open(path, 'rb') as file:
            content = file.read()
        if is_first:
            self.assertEqual([], poses.messages, 'none is claimed before it is found')
        states = [self.feeder.feed_all(self.image(i))['/follower']
                  for i in range(MAPPED, MAPPED + 20)]
        self.assertEqual(TrackingState.TRACKING, states[-1].state, states[-1].reason)
        self.assertIsNotNone(poses.wait_for_stamp(self.image(MAPPED + 19).header.stamp))
        refused = self.service('save_map', SaveMap, '/follower')('other.map')
        self.assertFalse(refused.success)
        self.assertIn('mapping', refused.message)
        with open(path, 'rb') as file:
            self.assertEqual(content, file.read())

    def pose_of(self, matrix, frame, covariance):
        message = PoseWithCovarianceStamped()
        message.header.frame_id = frame
        p, q = message.pose.pose.position, message.pose.pose.orientation
        p.x, p.y, p.z = matrix[:3, 3]
        q.w = 0.5 * math.sqrt(max(0.0, 1.0 + np.trace(matrix[:3, :3])))
        m = matrix
        q.x, q.y, q.z = [(m[2, 1] - m[1, 2]) / (4 * q.w), (m[0, 2] - m[2, 0]) / (4 * q.w),
                         (m[1, 0] - m[0, 1]) / (4 * q.w)]
        message.pose.covariance = [0.0] * 36
        for index, value in covariance.items():
            message.pose.covariance[index] = value
        return message

    def test_a_pose_as_rviz_sends_it_is_looked_at(self):
        self.map_and_load()
        given = harness.publisher('/initialpose', PoseWithCovarianceStamped)
        harness.wait_until(lambda: set(self.trackers) <= harness.listeners(given), what='listeners')
        # Position and heading on the ground; of height, roll and pitch it says nothing.
        message = self.pose_of(np.eye(4), 'map', {0: 1e-3, 7: 1e-3, 35: 1e-3})
        given.publish(message)
        harness.settle('/follower')
        self.assertIsNotNone(self.log.wait_for(
            lambda m: m.name == '/follower' and 'looking for the camera there' in m.msg))
        states = [self.feeder.feed_all(self.image(i))['/follower']
                  for i in range(MAPPED, MAPPED + 20)]
        self.assertEqual(TrackingState.TRACKING, states[-1].state, states[-1].reason)

    def test_a_pose_that_is_none_is_refused_by_name(self):
        self.map_and_load()
        given = harness.publisher('/initialpose', PoseWithCovarianceStamped)
        harness.wait_until(lambda: set(self.trackers) <= harness.listeners(given), what='listeners')
        for message, text in (
                (self.pose_of(np.eye(4), 'nowhere', {0: 1.0, 35: 1.0}), "'nowhere'"),
                (self.pose_of(np.eye(4), 'world', {}), 'covariance'),
                (PoseWithCovarianceStamped(), 'quaternion')):
            given.publish(message)
            refusal = self.log.wait_for(lambda m: m.name == '/follower' and
                                        'initialpose: refused' in m.msg and text in m.msg)
            self.assertIsNotNone(refusal, text)


if __name__ == '__main__':
    rospy.init_node('localisation_test')
    rostest.rosrun('active_matching_slam', 'localisation_test', LocalisationTest, sys.argv)
