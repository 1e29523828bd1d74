#!/usr/bin/env python3
"""The tracker on a robot: map_to_odom through the robot's own chain, odometry of the base, compressed
images, and what is said when nothing comes.

Parameters: ~bag. Nodes under test: /robot (map_to_odom), /base (camera, base_frame), /compressed,
/silent (no images).
"""

import math
import sys
import unittest

import numpy as np
import rospy
import rostest
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import CompressedImage
from tf2_msgs.msg import TFMessage

from active_matching_slam.msg import TrackingState
import harness

# Camera in the robot's base: looks forward, 0.3 m ahead and 0.5 m up. Columns: the optical axes.
T_BASE_CAMERA = np.array([[0.0, 0.0, 1.0, 0.3], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.5],
                          [0.0, 0.0, 0.0, 1.0]])
COUNT = 40


def quaternion_of(matrix):
    """x y z w of a rotation matrix with a rotation of less than half a turn."""
    w = 0.5 * math.sqrt(max(0.0, 1.0 + np.trace(matrix[:3, :3])))
    m = matrix
    return [(m[2, 1] - m[1, 2]) / (4 * w), (m[0, 2] - m[2, 0]) / (4 * w),
            (m[1, 0] - m[0, 1]) / (4 * w), w]


def transform_message(matrix, stamp, parent, child):
    message = TransformStamped()
    message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, parent, child
    t, r = message.transform.translation, message.transform.rotation
    t.x, t.y, t.z = matrix[:3, 3]
    r.x, r.y, r.z, r.w = quaternion_of(matrix)
    return message


class RobotTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.log = harness.Inbox('/rosout', Log)
        cls.recording = harness.Recording(rospy.get_param('~bag'))
        cls.camera_frame = cls.recording.images[0].header.frame_id
        cls.buffer = tf2_ros.Buffer(cache_time=rospy.Duration(1000))
        cls.listener = tf2_ros.TransformListener(cls.buffer)
        cls.broadcaster = tf2_ros.TransformBroadcaster()
        cls.fixed_broadcaster = tf2_ros.StaticTransformBroadcaster()
        transforms = harness.Inbox('/tf', TFMessage)  # the listener's connection is the same
        transforms.close()

    def lookup(self, parent, child, stamp):
        transform = self.buffer.lookup_transform(parent, child, stamp, rospy.Duration(harness.PATIENCE_S)).transform
        return harness.matrix_of(transform.translation, transform.rotation)

    def odometry(self, index):
        """T_odom_base: a robot that rolls and turns, whatever the camera sees."""
        matrix = np.eye(4)
        angle = 0.3 + 0.004 * index
        matrix[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
        matrix[:3, 3] = [2.0 + 0.01 * index, -1.0, 0.0]
        return matrix

    def feed(self, feeder, index):
        image = self.recording.images[index]
        self.broadcaster.sendTransform(
            transform_message(self.odometry(index), image.header.stamp, 'odom', 'base_link'))
        return feeder.feed(image)

    def test_map_to_odom_and_base_frame(self):
        first_stamp = self.recording.images[0].header.stamp
        self.fixed_broadcaster.sendTransform(
            transform_message(T_BASE_CAMERA, first_stamp, 'base_link', self.camera_frame))
        self.broadcaster.sendTransform(
            transform_message(self.odometry(0), first_stamp, 'odom', 'base_link'))
        feeder = harness.Feeder(['/robot', '/base'])
        nodes = {'/robot', '/base'}
        harness.wait_until(lambda: nodes <= harness.listeners(self.broadcaster.pub_tf) and
                           nodes <= harness.listeners(self.fixed_broadcaster.pub_tf),
                           what='listeners')
        poses = harness.Inbox('/robot/pose', PoseWithCovarianceStamped)
        odometry = harness.Inbox('/base/odometry', Odometry)
        base_poses = harness.Inbox('/base/pose', PoseWithCovarianceStamped)
        feeder.calibrate(self.recording.info)
        for index in range(COUNT):
            self.feed(feeder, index)

        last = self.recording.images[COUNT - 1].header.stamp
        pose = poses.wait_for_stamp(last)
        T_world_camera = harness.matrix_of_pose(pose.pose.pose)

        # The chain map, odom, base, camera ends where the tracker sees the camera.
        # The transform of this image between map and odom is dated ahead, the robot's own part is not.
        T_map_odom = self.lookup('map', 'odom', last + rospy.Duration(0.1))
        T_map_camera = T_map_odom.dot(self.lookup('odom', self.camera_frame, last))
        T_map_world = self.lookup('map', 'world', last)
        self.assertLess(np.abs(T_map_camera - T_map_world.dot(T_world_camera)).max(), 1e-6)
        # At the first image for which tf knew the robot, map lay on odom, so up is up.
        aligned = [np.abs(T_map_world.dot(harness.matrix_of_pose(message.pose.pose)) -
                          self.odometry(index).dot(T_BASE_CAMERA)).max()
                   for index, message in enumerate(
                       poses.wait_for_stamp(image.header.stamp)
                       for image in self.recording.images[:COUNT])]
        self.assertLess(min(aligned), 1e-6)

        # The other tracker speaks of the base: its pose is the camera's moved along the lever.
        message = odometry.wait_for_stamp(last)
        self.assertEqual('base_link', message.child_frame_id)
        T_world_base = harness.matrix_of_pose(message.pose.pose)
        camera = harness.matrix_of_pose(base_poses.wait_for_stamp(last).pose.pose)
        self.assertLess(np.abs(T_world_base.dot(T_BASE_CAMERA) - camera).max(), 1e-6)

    def test_compressed_images_are_tracked_without_a_plugin_and_with_a_calibration_from_a_file(self):
        feeder = harness.Feeder(['/compressed'], '/packed/image_raw/compressed',
                                '/packed/camera_info', CompressedImage)
        for index in range(5):
            raw = self.recording.images[index]
            image = harness.compressed(raw)
            state = feeder.feed(image)
        self.assertEqual(TrackingState.TRACKING, state.state, state.reason)
        image.header.stamp += rospy.Duration(1)
        image.data = image.data[:50]
        self.assertIsNone(feeder.feed_in_vain(image))
        image.header.stamp += rospy.Duration(1)
        image.data = harness.png(harness.pixels_of(self.recording.images[6]))
        self.assertIsNotNone(feeder.feed(image))

    def test_silence_is_named_with_the_resolved_topic(self):
        warning = self.log.wait_for(lambda m: m.name == '/silent' and 'No images on' in m.msg)
        self.assertIsNotNone(warning)
        self.assertIn('/nowhere/image_raw', warning.msg)
        self.assertIn('remap image?', warning.msg)
        diagnostics = harness.Inbox('/diagnostics', DiagnosticArray)
        self.assertIsNotNone(diagnostics.wait_for(lambda m: any(
            s.level == 2 and 'No images on /nowhere/image_raw' in s.message for s in m.status)))


if __name__ == '__main__':
    rospy.init_node('robot_test')
    rostest.rosrun('active_matching_slam', 'robot_test', RobotTest, sys.argv)
