#!/usr/bin/env python3
"""Images and calibrations as they should not be: named, left out, and no harm done.

Parameters: ~bag. Node under test: /tracker. AMS_FUZZ_INPUTS in the environment: how many malformed
messages are sent.
"""

import copy
import os
import random
import sys

import numpy as np
import rospy
import rostest
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import Image

from active_matching_slam.msg import FeatureArray, MatchingStatistics, TrackingState
import harness


class TruncatedImage(Image):
    """Ends in the middle on the wire."""

    def serialize(self, buff):
        start = buff.tell()
        super().serialize(buff)
        buff.truncate(start + (buff.tell() - start) // 2)
        buff.seek(0, 2)


class OddInputTest(harness.TrackerTestCase):

    def test_an_uncalibrated_camera_waits_and_a_calibrated_one_starts(self):
        self.addCleanup(self.feeder.calibrate, self.recording.info)
        inbox = self.inbox('pose', PoseWithCovarianceStamped)
        bad = copy.deepcopy(self.recording.info)
        bad.K = [0.0] * 9
        self.assertIsNone(self.feeder.feed_in_vain(self.image(0), bad))
        for broken in ([float('nan')] * 9, [-1.0] + list(self.recording.info.K[1:])):
            bad.K = broken
            self.assertIsNone(self.feeder.feed_in_vain(self.image(1), bad))
        self.assertEqual([], inbox.messages)
        state = self.feeder.feed(self.image(2), self.recording.info)
        self.assertEqual(TrackingState.TRACKING, state.state)

    def test_a_changed_calibration_starts_anew(self):
        self.addCleanup(self.feeder.calibrate, self.recording.info)
        inbox = self.inbox('path', Path)
        self.run_images(0, 5)
        changed = copy.deepcopy(self.recording.info)
        changed.K = [1.01 * k for k in changed.K[:8]] + [1.0]
        self.feeder.feed(self.image(5), changed)
        path = inbox.wait_for_stamp(self.image(5).header.stamp)
        self.assertEqual(1, len(path.poses))

    def test_images_of_another_size_are_left_out(self):
        self.run_images(0, 5)
        small = harness.pixels_of(self.images[5])[::2, ::2]
        state = self.feeder.feed(self.image(5, small))
        self.assertIn('%d x %d' % (small.shape[1], small.shape[0]), state.reason)
        states = self.run_images(6, 10)
        self.assertTrue(all(s.state == TrackingState.TRACKING for s in states))
        self.assertEqual('', states[-1].reason)

    def test_malformed_images_are_left_out(self):
        self.run_images(0, 3)
        for spoil in ({'data': b'123'}, {'encoding': 'sepia'}, {'step': 1}, {'width': 0},
                      {'height': 4000000000}, {'header': rospy.Header()}):
            image = copy.copy(self.image(3))
            for field, value in spoil.items():
                setattr(image, field, value)
            self.assertIsNone(self.feeder.feed_in_vain(image, patience_s=0.1), spoil)
        self.assertEqual(TrackingState.TRACKING, self.run_images(4, 8)[-1].state)

    def test_every_usual_encoding_is_tracked(self):
        gray = harness.pixels_of(self.images[0]).astype(np.uint8)
        deep = gray.astype(np.uint16) * 257
        color = np.repeat(gray[:, :, None], 3, axis=2)
        for index, (encoding, pixels) in enumerate(
                [('mono8', gray), ('bgr8', color), ('rgb8', color), ('mono16', deep),
                 ('bayer_rggb8', gray)]):
            self.start_anew()
            image = self.image(index)
            image.encoding = encoding
            image.is_bigendian = 0
            image.step = pixels.strides[0]
            image.data = pixels.tobytes()
            state = self.feeder.feed(image)
            self.assertEqual(TrackingState.TRACKING, state.state, encoding)

    def test_a_repeated_stamp_adds_nothing(self):
        inbox = self.inbox('pose', PoseWithCovarianceStamped)
        self.run_images(0, 3)
        self.assertIsNotNone(inbox.wait_for_stamp(self.image(2).header.stamp))
        state = self.feeder.feed(self.image(2))
        self.assertIn('stamp', state.reason)
        self.run_images(3, 4)
        self.assertIsNotNone(inbox.wait_for_stamp(self.image(3).header.stamp))
        stamps = [m.header.stamp for m in inbox.messages]
        self.assertEqual(len(set(stamps)), len(stamps))

    def test_a_calibration_that_comes_late_is_waited_for(self):
        self.addCleanup(self.feeder.calibrate, self.recording.info)
        resets = self.run_images(0, 5)[-1].resets
        broken = copy.deepcopy(self.recording.info)
        broken.K = [0.0] * 9
        self.assertIsNone(self.feeder.feed_in_vain(self.image(5), broken))
        state = self.feeder.feed(self.image(6), self.recording.info)
        self.assertEqual(TrackingState.TRACKING, state.state)
        self.assertEqual(resets, state.resets, 'the map waited')

    def spoilt(self, dice):
        """An image or a calibration with a few fields that can't be."""
        numbers = [0, 1, 2, 239, 240, 319, 320, 321, 640, 2**31, 2**32 - 1]
        reals = [0.0, -1.0, 1e300, -1e300, 1e-300, float('nan'), float('inf'), 300.0]
        if dice.random() < 0.3:
            info = copy.deepcopy(self.recording.info)
            for _ in range(dice.randint(1, 3)):
                info.K = list(info.K)
                dice.choice([
                    lambda: info.K.__setitem__(dice.randrange(9), dice.choice(reals)),
                    lambda: setattr(info, 'D', [dice.choice(reals)] * dice.randrange(15)),
                    lambda: setattr(info, 'width', dice.choice(numbers)),
                    lambda: setattr(info, 'height', dice.choice(numbers)),
                    lambda: setattr(info, 'binning_x', dice.choice(numbers)),
                    lambda: setattr(info.roi, 'width', dice.choice(numbers)),
                    lambda: setattr(info.roi, 'x_offset', dice.choice(numbers)),
                    lambda: setattr(info, 'distortion_model', dice.choice(['', 'equidistant', 'x']))
                ])()
            return info
        image = copy.copy(self.image(dice.randrange(len(self.images))))
        if dice.random() < 0.1:
            image = harness.as_class(image, TruncatedImage)
        for _ in range(dice.randint(1, 3)):
            dice.choice([
                lambda: setattr(image, 'width', dice.choice(numbers)),
                lambda: setattr(image, 'height', dice.choice(numbers)),
                lambda: setattr(image, 'step', dice.choice(numbers)),
                lambda: setattr(image, 'encoding', dice.choice(['bgr8', '32FC1', '', 'x', 'mono16'])),
                lambda: setattr(image, 'data', bytes(dice.randrange(5000))),
                lambda: setattr(image.header, 'stamp', rospy.Time(dice.choice(numbers), 0)),
                lambda: setattr(image.header, 'frame_id', dice.choice(['', '/', 'world', 'x y'])),
            ])()
        return image

    def test_a_storm_of_malformed_messages_leaves_nothing_behind(self):
        self.addCleanup(self.feeder.calibrate, self.recording.info)
        inboxes = [self.inbox(*topic) for topic in (
            ('pose', PoseWithCovarianceStamped), ('odometry', Odometry), ('path', Path),
            ('features', FeatureArray), ('statistics', MatchingStatistics))]
        dice = random.Random(1)
        for number in range(int(os.environ.get('AMS_FUZZ_INPUTS', 600))):
            message = self.spoilt(dice)
            publisher = self.feeder.images if isinstance(message, Image) else self.feeder.infos
            publisher.publish(message)
            if number % 5 == 0:  # a sound pair in between, so that there is something to disturb
                self.feeder.infos.publish(self.recording.info)
                self.feeder.images.publish(self.image(number % len(self.images)))
                rospy.sleep(0.01)
            if number % 100 == 99:
                for inbox in inboxes:
                    self.assertTrue(all(harness.all_finite(m) for m in inbox.messages), inbox.topic)
                    inbox.clear()
        self.feeder.calibrate(self.recording.info)
        self.start_anew()
        self.assertEqual(TrackingState.TRACKING, self.run_images(0, 5)[-1].state)


if __name__ == '__main__':
    rospy.init_node('odd_input_test')
    rostest.rosrun('active_matching_slam', 'odd_input_test', OddInputTest, sys.argv)
