#!/usr/bin/env python3
"""Lost and found, maps that are saved and loaded, and where the scale is from.

Parameters: ~bag. Nodes under test: /tracker, and /second (tf_mode none) on the same images.
"""

import os
import signal
import subprocess
import sys

import numpy as np
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from tf2_msgs.msg import TFMessage

from active_matching_slam.msg import FeatureArray, MatchingStatistics, TrackingState
from active_matching_slam.srv import LoadMap, SaveMap, SetScale
import harness


class LifecycleTest(harness.TrackerTestCase):

    trackers = ('/tracker', '/second')

    # -- lost and found ------------------------------------------------------------------------

    def test_a_kidnapped_camera_is_lost_and_found_again_in_the_same_map(self):
        features = self.inbox('features', FeatureArray)
        poses = self.inbox('pose', PoseWithCovarianceStamped)
        resets = self.run_images(0, 60)[-1].resets
        before = {f.id for f in features.wait_for_stamp(self.image(59).header.stamp).features}
        # Another place: the pictures upside down and mirrored, one after the other.
        for index in range(60, 90):
            pixels = harness.pixels_of(self.images[index])[::-1]
            state = self.feeder.feed(self.image(index, pixels))
        self.assertEqual(TrackingState.LOST, state.state)
        self.assertNotEqual('', state.reason)
        self.assertEqual(resets, state.resets)
        away = self.image(89).header.stamp
        states = self.run_images(90, len(self.images))
        self.assertEqual(TrackingState.TRACKING, states[-1].state, states[-1].reason)
        self.assertEqual(resets, states[-1].resets)
        last = self.image(len(self.images) - 1).header.stamp
        after = {f.id for f in features.wait_for_stamp(last).features}
        self.assertGreater(len(before & after), len(before) // 2)

        # One path before and after, in one scale; nothing in between.
        self.assertIsNotNone(poses.wait_for_stamp(last))
        self.assertIsNone(poses.wait_for_stamp(away, 0.0))
        received = [message for message in poses.messages
                if message.header.stamp.to_sec() > self.shift.to_sec()]
        truths = self.recording.truth_from_first(
            [message.header.stamp - self.shift for message in received])
        errors, _ = harness.position_errors_after_scaling(
            [harness.matrix_of_pose(message.pose.pose) for message in received], truths)
        excursion = max(np.linalg.norm(truth[:3, 3]) for truth in truths)
        self.assertLess(np.median(errors), 0.2 * excursion)

    # -- maps ----------------------------------------------------------------------------------

    def test_a_saved_map_serves_another_tracker(self):
        first_poses = self.inbox('pose', PoseWithCovarianceStamped)
        second_poses = self.inbox('pose', PoseWithCovarianceStamped, '/second')
        self.run_images(0, 60)
        self.assertTrue(self.service('set_scale', SetScale)(2.0).success)
        self.assertTrue(self.service('save_map', SaveMap)('shared.map').success)
        self.assertTrue(self.service('load_map', LoadMap, '/second')('shared.map').success)
        for index in range(60, 90):
            second = self.feeder.feed_all(self.image(index))['/second']
        self.assertEqual(TrackingState.TRACKING, second.state, second.reason)
        self.assertEqual('service', second.scale_source_name)
        stamp = self.image(89).header.stamp
        first = harness.matrix_of_pose(first_poses.wait_for_stamp(stamp).pose.pose)
        second = harness.matrix_of_pose(second_poses.wait_for_stamp(stamp).pose.pose)
        moved = np.linalg.norm(first[:3, 3])
        self.assertLess(np.linalg.norm(first[:3, 3] - second[:3, 3]), 0.05 * max(moved, 0.2))
        self.assertLess(harness.angle_between(first, second), 0.02)

    def test_a_damaged_or_foreign_file_changes_nothing(self):
        features = self.inbox('features', FeatureArray)
        resets = self.run_images(0, 30)[-1].resets
        answer = self.service('save_map', SaveMap)('whole.map')
        self.assertTrue(answer.success, answer.message)
        with open(answer.message, 'rb') as file:
            whole = file.read()
        folder = os.path.dirname(answer.message)
        flipped = bytearray(whole)
        flipped[len(flipped) // 2] ^= 4
        load = self.service('load_map', LoadMap)
        for name, content, cause in (('cut.map', whole[:len(whole) // 2], 'bytes'),
                                     ('flipped.map', bytes(flipped), 'checksum'),
                                     ('foreign.map', b'%YAML:1.0\nimage_width: 640\n',
                                      'not a map'), ('empty.map', b'', 'not a map')):
            with open(os.path.join(folder, name), 'wb') as file:
                file.write(content)
            answer = load(name)
            self.assertFalse(answer.success, name)
            self.assertIn(cause, answer.message)
            self.assertIn(name, answer.message)
        before = {f.id for f in features.wait_for_stamp(self.image(29).header.stamp).features}
        state = self.run_images(30, 31)[-1]
        self.assertEqual(TrackingState.TRACKING, state.state)
        self.assertEqual(resets, state.resets)
        after = {f.id for f in features.wait_for_stamp(self.image(30).header.stamp).features}
        self.assertGreater(len(before & after), 0.8 * len(before))

    def test_there_is_no_map_to_save_after_a_reset(self):
        answer = self.service('save_map', SaveMap)('none.map')
        self.assertFalse(answer.success)
        self.assertIn('no map', answer.message)

    # -- scale ---------------------------------------------------------------------------------

    def write_known_points(self, path, count):
        """Points of the map as a tracker saw them, far apart in the first image."""
        features = self.inbox('features', FeatureArray)
        self.run_images(0, 1)
        first = {f.id: f for f in features.wait_for_stamp(self.image(0).header.stamp).features}
        self.run_images(1, len(self.images))
        last = self.image(len(self.images) - 1).header.stamp
        K = np.array(self.recording.info.K).reshape(3, 3)
        known = []
        for feature in features.wait_for_stamp(last).features:
            p = np.array([feature.position.x, feature.position.y, feature.position.z])
            if feature.id not in first or p[2] < 0.1 or feature.successes < 40:
                continue
            u, v = K.dot(p / p[2])[:2]
            sigma = np.sqrt(np.trace(np.array(feature.position_covariance).reshape(3, 3)))
            if 20 < u < 300 and 20 < v < 220:
                known.append((sigma, p, (u, v)))
        known.sort(key=lambda item: item[0])
        chosen = []
        for item in known:
            if all(np.hypot(*np.subtract(item[2], other[2])) > 35 for other in chosen):
                chosen.append(item)
        self.assertGreaterEqual(len(chosen), count)
        with open(path, 'w') as file:
            file.write('points:\n')
            for _, p, pixel in chosen[:count]:
                file.write('  - {position_m: [%f, %f, %f], image_px: [%f, %f]}\n' %
                           (p[0], p[1], p[2], pixel[0], pixel[1]))

    def test_the_source_of_the_scale_is_told_by_log_state_statistics_and_diagnostics(self):
        target = os.path.join(rospy.get_param('/tracker/data_directory'), 'target.yaml')
        self.write_known_points(target, 5)
        rospy.set_param('/measured/known_target', target)
        rospy.set_param('/measured/tf_mode', 'none')
        self.addCleanup(rospy.delete_param, '/measured')
        printed = os.path.join(rospy.get_param('/tracker/data_directory'), 'measured.log')
        with open(printed, 'w') as output:
            node = subprocess.Popen(
                ['rosrun', 'active_matching_slam', 'active_matching_slam_node',
                 '__name:=measured', 'image:=/measured_camera/image_raw'],
                stdout=output, env=dict(os.environ, ROSCONSOLE_STDOUT_LINE_BUFFERED='1'))
        self.addCleanup(node.wait)
        self.addCleanup(node.send_signal, signal.SIGINT)
        feeder = harness.Feeder(['/measured'], '/measured_camera/image_raw',
                                '/measured_camera/camera_info')
        statistics = self.inbox('statistics', MatchingStatistics, '/measured')
        diagnostics = self.inbox('/diagnostics', DiagnosticArray)
        feeder.calibrate(self.recording.info)
        for index in range(3):
            state = feeder.feed(self.image(index))
        self.assertEqual(TrackingState.TRACKING, state.state, state.reason)
        self.assertEqual('known_points', state.scale_source_name)
        self.assertEqual(TrackingState.SCALE_KNOWN_POINTS, state.scale_source)
        message = statistics.wait_for_stamp(self.image(2).header.stamp)
        self.assertEqual(TrackingState.SCALE_KNOWN_POINTS, message.scale_source)
        with open(printed) as output:
            self.assertIn('scale comes from ' + target, output.read())
        self.assertIsNotNone(diagnostics.wait_for(lambda m: any(
            status.name.endswith('measured: tracking') and
            any(v.key == 'scale' and v.value == 'known_points' for v in status.values)
            for status in m.status)))

    # -- tf_mode none --------------------------------------------------------------------------

    def test_tf_mode_none_sends_no_transform(self):
        transforms = self.inbox('/tf', TFMessage)
        poses = self.inbox('pose', PoseWithCovarianceStamped, '/second')
        self.run_images(0, 5)
        self.assertIsNotNone(poses.wait_for_stamp(self.image(4).header.stamp))
        self.assertIsNotNone(transforms.wait_for_stamp(self.image(4).header.stamp))
        senders = {message._connection_header['callerid'] for message in transforms.messages}
        self.assertEqual({'/tracker'}, senders)


if __name__ == '__main__':
    rospy.init_node('lifecycle_test')
    rostest.rosrun('active_matching_slam', 'lifecycle_test', LifecycleTest, sys.argv)
