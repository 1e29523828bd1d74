#!/usr/bin/env python3
"""Endless images: memory and latency stay bounded, and resets under load are clean.

Parameters: ~bag, ~seconds: how long to run. AMS_SOAK_SECONDS in the environment wins over ~seconds.
"""

import os
import sys
import threading
import time
import xmlrpc.client

import rosgraph
import rospy
import rostest
from std_srvs.srv import Trigger

from active_matching_slam.msg import MatchingStatistics, TrackingState
import harness


class SoakTest(harness.TrackerTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        uri = rosgraph.Master('/soak').lookupNode('/tracker')
        cls.pid = xmlrpc.client.ServerProxy(uri).getPid('/soak')[2]
        cls.count = 0

    def next_image(self):
        """To and fro through the recording, with stamps that go on."""
        images = self.images
        index = self.count % (2 * len(images) - 2)
        if index >= len(images):
            index = 2 * len(images) - 2 - index
        stamp = images[0].header.stamp + rospy.Duration(self.count / 30.0)
        SoakTest.count += 1
        return harness.image_like(images[index], stamp)

    def resident_mb(self):
        with open('/proc/%d/status' % self.pid) as file:
            for line in file:
                if line.startswith('VmRSS:'):
                    return int(line.split()[1]) / 1024.0
        return None

    def test_memory_stays_bounded(self):
        seconds = float(os.environ.get('AMS_SOAK_SECONDS', rospy.get_param('~seconds')))
        inbox = self.inbox('statistics', MatchingStatistics)
        start = rospy.Time.now()
        at_rest, frames, features = None, 0, 0
        while (rospy.Time.now() - start).to_sec() < seconds or frames < 400:
            state = self.feeder.feed(self.next_image())
            frames += 1
            if frames % 100 == 0:
                features = max(features, inbox.messages[-1].features)
                inbox.clear()
            if frames == 300:
                at_rest = self.resident_mb()
        self.assertEqual(TrackingState.TRACKING, state.state)
        self.assertLessEqual(features, rospy.get_param('/tracker/map/maximum_features'))
        # Poses are kept, up to their limit: 100 bytes a frame and a little for the heap.
        self.assertLess(self.resident_mb() - at_rest, 16.0 + 2e-4 * frames)

    def test_resets_under_load(self):
        reset = self.service('reset', Trigger)
        done = threading.Event()

        def flood():
            while not done.is_set():
                self.feeder.images.publish(self.next_image())
                done.wait(0.002)

        source = threading.Thread(target=flood)
        source.start()
        try:
            for _ in range(100):
                self.assertTrue(reset().success)
        finally:
            done.set()
            source.join()
        self.assertTrue(reset().success)
        for _ in range(5):
            state = self.feeder.feed(self.next_image())
        self.assertEqual(TrackingState.TRACKING, state.state)
        self.assertGreater(state.resets, 0)

    def test_images_that_come_too_fast_are_dropped_and_counted(self):
        inbox = self.inbox('statistics', MatchingStatistics)
        self.feeder.feed(self.next_image())
        before = inbox.wait_for(lambda m: True).dropped_images
        images = [self.next_image() for _ in range(200)]
        for image in images:
            self.feeder.images.publish(image)
        last = inbox.wait_for_stamp(images[-1].header.stamp)
        self.assertIsNotNone(last, 'the newest image is always tracked')
        self.assertGreater(last.dropped_images, before)
        self.assertLess(len(inbox.messages), 200)

    def test_latency_stays_within_two_frames_of_the_tracker(self):
        """However fast the source: when an image comes, one frame is in work, and then it is its turn."""
        inbox = self.inbox('statistics', MatchingStatistics)
        answered_before = {}
        end = time.monotonic() + harness.PATIENCE_S
        while len(inbox.messages) < 100 and time.monotonic() < end:
            image = self.next_image()
            answered_before[image.header.stamp] = len(inbox.messages)
            self.feeder.images.publish(image)
            threading.Event().wait(0.002)
        self.feeder.feed(self.next_image())
        # Answers on their way here while an image is sent count too: seldom, and few.
        frames = sorted(number + 1 - answered_before[message.header.stamp]
                        for number, message in enumerate(inbox.messages)
                        if message.header.stamp in answered_before)
        self.assertGreater(len(frames), 20)
        self.assertLess(len(frames), len(answered_before), 'the source must be the faster one')
        self.assertLessEqual(frames[len(frames) // 2], 2)
        self.assertLessEqual(frames[-1], 6)


if __name__ == '__main__':
    rospy.init_node('soak_test')
    rostest.rosrun('active_matching_slam', 'soak_test', SoakTest, sys.argv)
