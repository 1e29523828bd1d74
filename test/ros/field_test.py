#!/usr/bin/env python3
"""Cases from the field: what is wrong is said, where people look, and does no more harm than it must.

Parameters: ~bag. Nodes under test: /tracker, /expects_raw and /expects_packed (compressed images on
/packed/image_raw), /rectified (images on /rectified_camera/image_rect).
"""

import copy
import sys

import numpy as np
import rospy
import rostest
import tf2_ros
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import CompressedImage, Image

from active_matching_slam.msg import Feature, FeatureArray, TrackingState
import harness

MASKED_FROM = 160  # row


class FieldTest(harness.TrackerTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.log = harness.Inbox('/rosout', Log)

    def warning(self, text, node='/tracker'):
        message = self.log.wait_for(lambda m: m.name == node and text in m.msg)
        self.assertIsNotNone(message, text)
        return message.msg

    def test_what_can_not_be_read_is_said_in_the_state(self):
        self.run_images(0, 3)
        image = self.image(3)
        image.encoding = '32FC1'
        state = self.feeder.feed(image)
        self.assertIn('32FC1', state.reason)
        self.assertEqual(TrackingState.TRACKING, self.run_images(4, 6)[-1].state)

    def test_a_late_image_is_left_out_and_the_map_is_kept(self):
        resets = self.run_images(0, 10)[-1].resets
        state = self.feeder.feed(self.image(8))
        self.assertIn('late', state.reason)
        after = self.run_images(10, 12)[-1]
        self.assertEqual((TrackingState.TRACKING, resets), (after.state, after.resets))

    def test_images_of_a_second_camera_on_the_topic_are_left_out_by_name(self):
        self.run_images(0, 5)
        image = self.image(5)
        image.header.frame_id = 'right'
        self.assertIn('two cameras on one topic', self.feeder.feed(image).reason)
        self.assertEqual(TrackingState.TRACKING, self.run_images(6, 8)[-1].state)

    def test_a_second_parent_of_the_cameras_frame_is_named(self):
        self.run_images(0, 3)
        transform = TransformStamped()
        transform.header.stamp = self.image(3).header.stamp
        transform.header.frame_id = 'robot_arm'
        transform.child_frame_id = self.image(3).header.frame_id
        transform.transform.rotation.w = 1.0
        broadcaster = tf2_ros.TransformBroadcaster()
        harness.wait_until(lambda: '/tracker' in harness.listeners(broadcaster.pub_tf),
                           what='listener')
        broadcaster.sendTransform(transform)
        warning = self.warning('two parents')
        self.assertIn("'robot_arm'", warning)
        self.assertIn('map_to_odom', warning)

    def test_a_calibration_that_can_hardly_be_right_is_named(self):
        self.addCleanup(self.feeder.calibrate, self.recording.info)
        info = copy.deepcopy(self.recording.info)
        info.K = [k / 320.0 for k in info.K[:8]] + [1.0]
        self.feeder.calibrate(info)
        self.feeder.images.publish(self.image(0))
        self.assertIn('fx = ', self.warning('can hardly be right'))

    def test_compressed_images_without_that_in_the_topics_name(self):
        images = harness.publisher('/packed/image_raw', CompressedImage)
        infos = harness.publisher('/packed/camera_info', type(self.recording.info))
        warning = self.warning('image_transport:=compressed', '/expects_raw')
        self.assertIn('sensor_msgs/CompressedImage', warning)
        harness.wait_until(lambda: '/expects_packed' in harness.listeners(images) and
                           '/expects_packed' in harness.listeners(infos), what='listener')
        states = self.inbox('state', TrackingState, '/expects_packed')
        infos.publish(self.recording.info)
        harness.settle('/expects_packed')
        for index in range(5):
            images.publish(harness.compressed(self.image(index)))
        self.assertIsNotNone(states.wait_for(lambda s: s.state == TrackingState.TRACKING))

    def test_rectified_images_are_those_of_the_projection(self):
        feeder = harness.Feeder(['/rectified'], '/rectified_camera/image_rect',
                                '/rectified_camera/camera_info')
        info = copy.deepcopy(self.recording.info)
        info.P = [0.0] * 12
        self.assertIsNone(feeder.feed_in_vain(self.image(0), info))
        info.P = [info.K[0], 0, info.K[2], 0, 0, info.K[4], info.K[5], 0, 0, 0, 1, 0]
        state = feeder.feed(self.image(1), info)
        self.assertEqual(TrackingState.TRACKING, state.state, state.reason)

    # -- masks -----------------------------------------------------------------------------------

    def mask(self, stamp, **fields):
        pixels = np.full((self.recording.info.height, self.recording.info.width), 255, np.uint8)
        pixels[MASKED_FROM:] = 0
        mask = harness.image_like(self.images[0], stamp, pixels)
        for field, value in fields.items():
            setattr(mask, field, value)
        return mask

    def mask_publisher(self):
        masks = harness.publisher('/tracker/mask', Image)
        harness.wait_until(lambda: '/tracker' in harness.listeners(masks), what='listener')
        white = self.mask(rospy.Time(1))
        white.data = b'\xff' * len(white.data)
        self.addCleanup(masks.publish, white)
        return masks

    def assert_nothing_matched_behind_the_mask(self, features):
        matched = [f.matched_px[1] for f in features.features if f.status == Feature.MATCHED]
        self.assertGreater(len(matched), 10)
        self.assertLess(max(matched), MASKED_FROM)

    def test_a_mask_holds_from_its_arrival_on(self):
        features = self.inbox('features', FeatureArray)
        masks = self.mask_publisher()
        masks.publish(self.mask(rospy.Time(1)))
        harness.settle('/tracker')
        self.run_images(0, 5)
        self.assert_nothing_matched_behind_the_mask(
            features.wait_for_stamp(self.image(4).header.stamp))

    def test_an_image_waits_for_the_mask_that_comes_with_it(self):
        features = self.inbox('features', FeatureArray)
        masks = self.mask_publisher()
        states = self.feeder.states['/tracker']
        for index in range(6):
            image = self.image(index)
            states.clear()
            self.feeder.images.publish(image)
            harness.settle('/tracker')
            if index > 1:  # by then it knows that masks come with the images
                rospy.sleep(0.1)
                self.assertIsNone(states.wait_for_stamp(image.header.stamp, 0.0), index)
            masks.publish(self.mask(image.header.stamp))
            self.assertIsNotNone(states.wait_for_stamp(image.header.stamp), index)
        self.assert_nothing_matched_behind_the_mask(
            features.wait_for_stamp(self.image(5).header.stamp))

    def test_a_mask_of_a_wrong_size_or_type_is_named_and_not_used(self):
        masks = self.mask_publisher()
        for fields, text in (({'encoding': 'bgr8', 'width': 40, 'height': 2, 'step': 120,
                               'data': bytes(240)}, "'bgr8'"),
                             ({'width': 160, 'step': 160, 'height': 120,
                               'data': b'\xff' * (160 * 120)}, '160 x 120')):
            masks.publish(self.mask(rospy.Time(1), **fields))
            harness.settle('/tracker')
            state = self.run_images(0, 2)[-1]
            self.assertEqual(TrackingState.TRACKING, state.state)
            self.assertIn('/tracker/mask is not used', self.warning(text))
            self.start_anew()


if __name__ == '__main__':
    rospy.init_node('field_test')
    rostest.rosrun('active_matching_slam', 'field_test', FieldTest, sys.argv)
