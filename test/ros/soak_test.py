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

CAMERA_HZ = 30.0


class Correspondence(harness.Inbox):
    """Images sent to the tracker, the ~statistics that answer them, and how long each took.

    In frames, an image's latency is the number of answers from its sending to its own, its own
    included. Answers that are on their way here while it is sent count too: seldom, and few.
    """

    def __init__(self, publisher):
        self._publisher = publisher
        self._sent = {}  # stamp: when, and how many answers had come by then
        self.answered = self.passed_over = 0
        self.latencies = []  # of each answer: milliseconds, frames
        super().__init__('/tracker/statistics', MatchingStatistics)

    def send(self, image):
        with self._changed:
            self._sent[image.header.stamp] = time.monotonic(), self.answered
        self._publisher.publish(image)

    def _receive(self, message):
        now = time.monotonic()
        with self._changed:
            self.answered += 1
            # What was sent before it and has no answer by now will never get one.
            while self._sent:
                stamp = next(iter(self._sent))
                sent_at, answered_then = self._sent.pop(stamp)
                if stamp == message.header.stamp:
                    self.latencies.append((1e3 * (now - sent_at), self.answered - answered_then))
                    break
                self.passed_over += 1
        super()._receive(message)

    def take_latencies(self):
        """Those since the last call: [ms] and [frames], each in ascending order."""
        with self._changed:
            latencies, self.latencies = self.latencies, []
        return [sorted(column) for column in zip(*latencies)]


class SoakTest(harness.TrackerTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        uri = rosgraph.Master('/soak').lookupNode('/tracker')
        cls.pid = xmlrpc.client.ServerProxy(uri).getPid('/soak')[2]
        cls.count = 0

    def correspondence(self):
        """Begins with an image that has been answered: what came before plays no part."""
        letters = Correspondence(self.feeder.images)
        self.addCleanup(letters.close)
        self.feeder.feed(self.next_image())
        self.dropped_before = letters.wait_for(lambda m: True).dropped_images
        letters.clear()
        return letters

    def next_image(self):
        """To and fro through the recording, with stamps that go on."""
        images = self.images
        index = self.count % (2 * len(images) - 2)
        if index >= len(images):
            index = 2 * len(images) - 2 - index
        stamp = images[0].header.stamp + rospy.Duration(self.count / CAMERA_HZ)
        SoakTest.count += 1
        return harness.image_like(images[index], stamp)

    def resident_mb(self):
        with open('/proc/%d/status' % self.pid) as file:
            for line in file:
                if line.startswith('VmRSS:'):
                    return int(line.split()[1]) / 1024.0
        return None

    def listen(self, topic):
        """And keep nothing."""
        subscriber = rospy.Subscriber(topic, rospy.AnyMsg, lambda message: None)
        self.addCleanup(subscriber.unregister)

    def finish(self, letters):
        """Waits for the answer to one more image: up to it every image was answered or counted."""
        last = self.next_image()
        letters.send(last)
        answer = letters.wait_for_stamp(last.header.stamp)
        self.assertIsNotNone(answer, 'the newest image is always tracked')
        self.assertEqual(letters.passed_over, answer.dropped_images - self.dropped_before)
        return answer

    def soak(self, next_image):
        """A camera's images in real time, every topic listened to. The last state, and a table."""
        letters = self.correspondence()
        states = self.feeder.states['/tracker']
        for topic, _ in rospy.get_published_topics('/tracker'):
            if topic not in (letters.topic, states.topic):
                self.listen(topic)
        seconds = float(os.environ.get('AMS_SOAK_SECONDS', rospy.get_param('~seconds'))) / 2.0
        count = max(400, int(seconds * CAMERA_HZ))
        at_rest, features = None, 0
        print('\n   time    images  dropped  resets  features  resident  latency: median  most')
        due = start = time.monotonic()
        for sent in range(1, count + 1):
            letters.send(next_image())
            due += 1.0 / CAMERA_HZ
            threading.Event().wait(max(0.0, due - time.monotonic()))
            if sent == 300:
                at_rest = self.resident_mb()
            if sent % max(100, count // 12) == 0:
                ms, frames = letters.take_latencies()
                last = letters.messages[-1]
                features = max([features] + [m.features for m in letters.messages])
                print('%5.0f s  %8d  %7d  %6d  %8d  %5.1f MB  %12.1f ms  %.1f ms' %
                      (time.monotonic() - start, sent, letters.passed_over,
                       states.messages[-1].resets, last.features, self.resident_mb(),
                       ms[len(ms) // 2], ms[-1]), flush=True)
                self.assertLessEqual(frames[len(frames) // 2], 2)
                letters.clear()
                states.clear()
        # Poses are kept, up to their limit: 100 bytes a frame and a little for the heap.
        self.assertLess(self.resident_mb() - at_rest, 16.0 + 2e-4 * count)
        self.assertLessEqual(features, rospy.get_param('/tracker/map/maximum_features'))
        answer = self.finish(letters)
        self.assertEqual(TrackingState.TRACKING, answer.state)
        return states.wait_for_stamp(answer.header.stamp)

    def test_memory_and_latency_stay_bounded(self):
        self.soak(self.next_image)

    def test_memory_and_latency_stay_bounded_in_a_looped_bag(self):
        resets = self.feeder.feed(self.next_image()).resets
        pictures, bag = len(self.images), []
        played = 0

        def next_image():
            nonlocal played
            if played < pictures:
                bag.append(self.next_image())
            played += 1
            return bag[(played - 1) % pictures]

        state = self.soak(next_image)
        self.assertEqual((played - 1) // pictures, state.resets - resets)

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
        letters = self.correspondence()
        for _ in range(5):
            for image in [self.next_image() for _ in range(40)]:
                letters.send(image)
            self.finish(letters)
        self.assertGreater(letters.passed_over, 0)
        self.assertLess(letters.answered, 200)

    def test_latency_stays_within_two_frames_of_the_tracker(self):
        """However fast the source: at each answer it has three images more.

        When an image comes, one frame is in work, and then it is its turn.
        """
        letters = self.correspondence()
        images_at_once, answers = 3, 200
        while letters.answered < answers:
            answered = letters.answered
            for _ in range(images_at_once):
                letters.send(self.next_image())
            harness.wait_until(lambda: letters.answered > answered, what='answer')
        self.finish(letters)
        _, frames = letters.take_latencies()
        print('latency in frames:', {n: frames.count(n) for n in sorted(set(frames))},
              'dropped:', letters.passed_over)
        self.assertGreater(letters.passed_over, answers // 2)
        self.assertLessEqual(frames[len(frames) // 2], 2)
        self.assertLessEqual(frames[-1], images_at_once + 2)


if __name__ == '__main__':
    rospy.init_node('soak_test')
    rostest.rosrun('active_matching_slam', 'soak_test', SoakTest, sys.argv)
