#!/usr/bin/env python3
"""The tracker in a ROS graph, as node and as nodelet: pose, tf, covariances, stamps, services.

Parameters: ~bag (simulated, with truth). Node under test: /tracker.
"""

import math
import os
import sys

import numpy as np
import rospy
import rostest
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import Image, PointCloud2
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from active_matching_slam.msg import (FeatureArray, MatchHypotheses, MatchingStatistics,
                                      MutualInformationGraph, SubmapHierarchy, TrackingState)
from active_matching_slam.srv import (LoadMap, SaveMap, SaveTrajectory, SetMatcher, SetScale)
import harness

TOPICS = {
    'pose': PoseWithCovarianceStamped, 'odometry': Odometry, 'path': Path, 'map': PointCloud2,
    'features': FeatureArray, 'statistics': MatchingStatistics, 'hypotheses': MatchHypotheses,
    'mutual_information': MutualInformationGraph, 'submaps': SubmapHierarchy,
    'markers/features': MarkerArray, 'markers/mutual_information': MarkerArray,
    'markers/submaps': MarkerArray, 'markers/camera': MarkerArray, 'debug_image': Image,
}


class TrackerTest(harness.TrackerTestCase):

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.buffer = tf2_ros.Buffer(cache_time=rospy.Duration(1000))
        cls.listener = tf2_ros.TransformListener(cls.buffer)
        transforms = harness.Inbox('/tf', TFMessage)  # the listener's connection is the same
        transforms.close()

    def poses(self, inbox, count):
        stamps = [self.image(i).header.stamp for i in range(count)]
        messages = [inbox.wait_for_stamp(stamp) for stamp in stamps]
        self.assertNotIn(None, messages)
        return messages

    # -- what is said of the camera ------------------------------------------------------------

    def test_pose_follows_the_truth(self):
        inbox = self.inbox('pose', PoseWithCovarianceStamped)
        count = len(self.images)
        states = self.run_images(0, count)
        self.assertTrue(all(s.state == TrackingState.TRACKING for s in states))
        messages = self.poses(inbox, count)
        estimates = [harness.matrix_of_pose(m.pose.pose) for m in messages]
        truths = self.recording.truth_from_first([i.header.stamp for i in self.images])
        errors, scale = harness.position_errors_after_scaling(estimates, truths)
        excursion = max(np.linalg.norm(t[:3, 3]) for t in truths)
        self.assertGreater(scale, 0, 'a negative scale is a motion in the wrong direction')
        self.assertLess(math.sqrt((errors ** 2).mean()), 0.1 * excursion)
        angles = [harness.angle_between(e, t) for e, t in zip(estimates, truths)]
        self.assertLess(max(angles), math.radians(2.0))
        for message in messages:
            self.assertEqual('world', message.header.frame_id)

    def test_tf_has_the_direction_and_the_axes_of_a_known_motion(self):
        self.run_images(0, len(self.images))
        last = self.image(len(self.images) - 1)
        transform = self.buffer.lookup_transform('world', last.header.frame_id, last.header.stamp,
                                                 rospy.Duration(harness.PATIENCE_S))
        T_world_camera = harness.matrix_of(transform.transform.translation,
                                           transform.transform.rotation)
        truth = self.recording.truth_from_first(
            [self.images[0].header.stamp, self.images[-1].header.stamp])[1]
        moved, moved_truth = T_world_camera[:3, 3], truth[:3, 3]
        cosine = moved.dot(moved_truth) / np.linalg.norm(moved) / np.linalg.norm(moved_truth)
        self.assertGreater(cosine, math.cos(math.radians(15.0)),
                           'moved %s, in truth along %s' % (moved, moved_truth))
        self.assertLess(harness.angle_between(T_world_camera, truth), math.radians(2.0))

    def test_pose_tf_and_odometry_agree(self):
        poses, odometry = self.inbox('pose', PoseWithCovarianceStamped), self.inbox('odometry',
                                                                                    Odometry)
        count = 10
        self.run_images(0, count)
        for pose, odom in zip(self.poses(poses, count), self.poses(odometry, count)):
            self.assertEqual(pose.pose, odom.pose)
            self.assertEqual(pose.header.frame_id, odom.header.frame_id)
            self.assertEqual(self.images[0].header.frame_id, odom.child_frame_id)
            self.assertNotEqual(odom.header.frame_id, odom.child_frame_id)
            transform = self.buffer.lookup_transform(
                odom.header.frame_id, odom.child_frame_id, odom.header.stamp, rospy.Duration(harness.PATIENCE_S))
            difference = harness.matrix_of_pose(pose.pose.pose) - harness.matrix_of(
                transform.transform.translation, transform.transform.rotation)
            self.assertLess(np.abs(difference).max(), 1e-9)

    def test_covariances_are_proper_and_neither_zero_nor_deviations(self):
        inbox = self.inbox('odometry', Odometry)
        self.run_images(0, 30)
        for odometry in self.poses(inbox, 30)[1:]:
            for covariance in (odometry.pose.covariance, odometry.twist.covariance):
                matrix = np.array(covariance).reshape(6, 6)
                self.assertLess(np.abs(matrix - matrix.T).max(), 1e-9)
                self.assertGreater(np.linalg.eigvalsh(matrix).min(), 0.0)

    def test_velocity_is_that_of_the_poses_in_the_camera_frame(self):
        inbox = self.inbox('odometry', Odometry)
        count = len(self.images)
        self.run_images(0, count)
        messages = self.poses(inbox, count)
        errors, errors_if_in_world, speeds = [], [], []
        late = messages[count // 2:]  # by then the camera has turned
        for before, now, after in zip(late, late[1:], late[2:]):
            dt = (after.header.stamp - before.header.stamp).to_sec()
            velocity_world = (harness.matrix_of_pose(after.pose.pose) -
                              harness.matrix_of_pose(before.pose.pose))[:3, 3] / dt
            R_world_camera = harness.matrix_of_pose(now.pose.pose)[:3, :3]
            v = now.twist.twist.linear
            published = np.array([v.x, v.y, v.z])
            errors.append(np.linalg.norm(R_world_camera.T.dot(velocity_world) - published))
            errors_if_in_world.append(np.linalg.norm(velocity_world - published))
            speeds.append(np.linalg.norm(velocity_world))
        self.assertLess(np.median(errors), 0.5 * np.median(speeds))
        self.assertLess(np.median(errors), np.median(errors_if_in_world))

    # -- everything published ------------------------------------------------------------------

    def test_every_topic_carries_the_stamp_of_its_image_and_nothing_is_nan(self):
        inboxes = {name: self.inbox(name, kind) for name, kind in TOPICS.items()}
        diagnostics = self.inbox('/diagnostics', DiagnosticArray)
        transforms = self.inbox('/tf', TFMessage)
        self.run_images(0, 12)
        last = self.image(11)
        self.assertIsNotNone(transforms.wait_for_stamp(last.header.stamp))
        for name, inbox in inboxes.items():
            message = inbox.wait_for_stamp(last.header.stamp)
            self.assertIsNotNone(message, '%s has no message for the last image' % name)
            for message in inbox.messages:
                self.assertTrue(harness.all_finite(message), '%s: not a number' % name)
            frame = (message.markers[-1].header.frame_id if 'markers/' in name
                     else message.header.frame_id)
            wanted = ('world', ) if name not in ('debug_image', 'statistics', 'hypotheses') else (
                last.header.frame_id, )
            self.assertIn(frame, wanted, name)
        features = inboxes['features'].wait_for_stamp(last.header.stamp)
        self.assertGreater(len(features.features), 10)
        statistics = inboxes['statistics'].wait_for_stamp(last.header.stamp)
        self.assertGreater(statistics.matched, 5)
        self.assertEqual(TrackingState.SCALE_FREE, statistics.scale_source)
        submaps = inboxes['submaps'].wait_for_stamp(last.header.stamp)
        self.assertGreater(len(submaps.levels), 1)
        self.assertTrue(inboxes['mutual_information'].wait_for_stamp(last.header.stamp).links)
        self.assertTrue(inboxes['hypotheses'].wait_for_stamp(last.header.stamp).hypotheses)
        cloud = inboxes['map'].wait_for_stamp(last.header.stamp)
        self.assertEqual(['x', 'y', 'z', 'sigma', 'id', 'submap', 'rgb'],
                         [field.name for field in cloud.fields])
        self.assertEqual('bgr8', inboxes['debug_image'].wait_for_stamp(last.header.stamp).encoding)
        published = {}
        for name in ('images', 'tracking'):
            report = diagnostics.wait_for(lambda message: any(
                status.name.endswith(': ' + name) for status in message.status))
            published.update((value.key, value.value) for status in report.status
                        if status.name.endswith(': ' + name) for value in status.values)
        self.assertLessEqual({
            'received [Hz]', 'tracked [Hz]', 'dropped', 'latency from stamp, mean [ms]', 'state',
            'scale', 'matcher', 'features', 'candidates', 'matched', 'resets', 'times lost',
            'NIS by its degrees of freedom (1 when consistent)'}, set(published))

    def test_what_nobody_listens_to_is_not_computed(self):
        statistics = self.inbox('statistics', MatchingStatistics)
        self.run_images(0, 10)
        self.inbox('submaps', SubmapHierarchy)
        self.run_images(10, 20)
        self.assertIsNotNone(statistics.wait_for_stamp(self.image(19).header.stamp))
        times_ms = [message.structure_ms for message in statistics.messages]
        self.assertLess(min(times_ms[:10]), 0.001)
        self.assertGreater(min(times_ms[10:]), 0.001)

    def test_path_holds_each_pose_with_its_own_stamp(self):
        inbox = self.inbox('path', Path)
        self.run_images(0, 5)
        path = inbox.wait_for_stamp(self.image(4).header.stamp)
        self.assertEqual([self.image(i).header.stamp for i in range(5)],
                         [pose.header.stamp for pose in path.poses])

    # -- life cycle ----------------------------------------------------------------------------

    def test_reset_twenty_times_in_mid_stream(self):
        reset = self.service('reset', Trigger)
        for turn in range(20):
            states = self.run_images(3 * turn, 3 * turn + 3)
            self.assertEqual(TrackingState.TRACKING, states[-1].state)
            self.assertTrue(reset().success)
        resets = self.run_images(60, 61)[-1].resets
        self.assertGreaterEqual(resets, 20)

    def test_a_looped_bag_resets_once_and_goes_on(self):
        before = self.run_images(0, 45)[-1]  # of more than a second: less is a late image
        states = self.run_images(0, 20)
        self.assertEqual(before.resets + 1, states[0].resets)
        self.assertEqual(before.resets + 1, states[-1].resets)
        self.assertEqual(TrackingState.TRACKING, states[-1].state)

    def test_black_images_claim_nothing_new_and_harm_nothing(self):
        inbox = self.inbox('pose', PoseWithCovarianceStamped)
        self.run_images(0, 10)
        black = np.zeros((self.images[0].height, self.images[0].width))
        for index in range(10, 14):
            self.feeder.feed(self.image(index, black))
        states = self.run_images(14, 30)
        self.assertEqual(TrackingState.TRACKING, states[-1].state)
        self.assertTrue(all(harness.all_finite(m) for m in inbox.messages))

    def cover_lens(self, first):
        """The first state after image `first` that is not TRACKING any more, and its index."""
        for index in range(first, len(self.images) - 1):
            state = self.feeder.feed(self.image(index, self.covered_lens(index)))
            if state.state != TrackingState.TRACKING:
                return state, index
        return self.fail('a covered lens is still tracked with')

    def covered_lens(self, index):
        """A new picture each time: the hand over the lens moves."""
        noise = np.random.RandomState(index)
        return noise.randint(0, 40, (self.images[0].height, self.images[0].width))

    def test_lost_with_no_depths_known_begins_anew_and_says_why(self):
        before = self.run_images(0, 5)[-1]
        lost, index = self.cover_lens(5)
        self.assertEqual(TrackingState.LOST, lost.state)
        anew = self.feeder.feed(self.image(index + 1, self.covered_lens(index + 1)))
        self.assertEqual(before.resets + 1, anew.resets)
        self.assertNotEqual(TrackingState.LOST, anew.state)
        self.assertIn('too few features of known depth', anew.reason)

    def test_a_lost_camera_claims_no_pose_and_says_why(self):
        self.run_images(0, 40)
        transforms = self.inbox('/tf', TFMessage)
        inbox = self.inbox('pose', PoseWithCovarianceStamped)
        state, index = self.cover_lens(40)
        self.assertEqual(TrackingState.LOST, state.state)
        self.assertNotEqual('', state.reason)
        blind = self.feeder.feed(self.image(index + 1, self.covered_lens(index + 1)))
        self.assertEqual(TrackingState.LOST, blind.state)
        self.assertIsNone(inbox.wait_for_stamp(blind.header.stamp, 1.0))
        self.assertIsNone(transforms.wait_for_stamp(blind.header.stamp, 0.0))

    # -- services and run-time changes ---------------------------------------------------------

    def test_scale_set_by_service_multiplies_what_follows_and_is_said(self):
        inbox = self.inbox('pose', PoseWithCovarianceStamped)
        states = self.run_images(0, 60)
        self.assertEqual('free', states[-1].scale_source_name)
        before = inbox.wait_for_stamp(self.image(59).header.stamp).pose.pose.position
        set_scale = self.service('set_scale', SetScale)
        for bad in (0.0, -2.0, float('nan'), float('inf')):
            self.assertFalse(set_scale(bad).success)
        self.assertTrue(set_scale(3.0).success)
        state = self.feeder.feed(self.image(60))
        after = inbox.wait_for_stamp(self.image(60).header.stamp).pose.pose.position
        self.assertEqual('service', state.scale_source_name)
        ratio = np.linalg.norm([after.x, after.y, after.z]) / np.linalg.norm(
            [before.x, before.y, before.z])
        self.assertAlmostEqual(3.0, ratio, delta=0.3)

    def test_files_keep_to_the_data_directory(self):
        self.run_images(0, 5)
        for name, kind in (('save_map', SaveMap), ('load_map', LoadMap),
                           ('save_trajectory', SaveTrajectory)):
            service = self.service(name, kind)
            for bad in ('', '..', '../x', '/tmp/x', 'a/b', '.hidden', 'x\n'):
                answer = service(bad)
                self.assertFalse(answer.success, '%s %r' % (name, bad))
                self.assertIn('file name', answer.message)
        self.assertFalse(self.service('load_map', LoadMap)('nothing-of-the-kind').success)

    def test_trajectory_is_saved_in_tum_format(self):
        inbox = self.inbox('pose', PoseWithCovarianceStamped)
        self.run_images(0, 5)
        messages = self.poses(inbox, 5)
        answer = self.service('save_trajectory', SaveTrajectory)('walk.txt')
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(5, answer.poses)
        self.assertEqual('walk.txt', os.path.basename(answer.message))
        with open(answer.message) as file:
            rows = [[float(field) for field in line.split()] for line in file]
        for row, message in zip(rows, messages):
            p, q = message.pose.pose.position, message.pose.pose.orientation
            self.assertAlmostEqual(message.header.stamp.to_sec(), row[0], places=6)
            for wanted, got in zip((p.x, p.y, p.z, q.x, q.y, q.z, q.w), row[1:]):
                self.assertAlmostEqual(wanted, got, places=6)

    def test_a_saved_map_is_loaded_and_the_camera_found_in_it(self):
        self.run_images(0, 30)
        answer = self.service('save_map', SaveMap)('room.map')
        self.assertTrue(answer.success, answer.message)
        self.service('reset', Trigger)()
        self.assertTrue(self.service('load_map', LoadMap)('room.map').success)
        states = self.run_images(30, 50)
        self.assertEqual(TrackingState.TRACKING, states[-1].state, states[-1].reason)

    def test_matcher_changes_without_losing_the_map(self):
        inbox = self.inbox('statistics', MatchingStatistics)
        self.addCleanup(self.service('set_matcher', SetMatcher), 'auto')
        set_matcher = self.service('set_matcher', SetMatcher)
        resets = self.run_images(0, 5)[-1].resets
        for index, name in enumerate(('jcbb', 'active_search', 'active', 'chow_liu')):
            self.assertTrue(set_matcher(name).success)
            state = self.feeder.feed(self.image(5 + index))
            message = inbox.wait_for_stamp(self.image(5 + index).header.stamp)
            self.assertEqual(name, message.matcher)
            self.assertGreater(message.matched, 5)
        self.assertEqual(resets, state.resets)
        answer = set_matcher('magic')
        self.assertFalse(answer.success)
        self.assertIn('magic', answer.message)

    def test_reconfigure_applies_clips_and_refuses_by_name(self):
        client = Client(self.trackers[0], timeout=harness.PATIENCE_S)
        self.addCleanup(client.update_configuration, {
            'map/features_per_frame': 60, 'image/match_threshold': 0.8, 'matcher': 'auto'})
        resets = self.run_images(0, 3)[-1].resets
        inbox = self.inbox('statistics', MatchingStatistics)
        result = client.update_configuration({'map/features_per_frame': 10, 'matcher': 'jcbb'})
        self.assertEqual(10, result['map/features_per_frame'])
        self.assertEqual(resets, self.run_images(3, 5)[-1].resets)
        message = inbox.wait_for_stamp(self.image(4).header.stamp)
        self.assertLessEqual(message.candidates, 10)
        self.assertEqual('jcbb', message.matcher)
        result = client.update_configuration({'image/match_threshold': 5.0})
        self.assertEqual(0.999, result['image/match_threshold'])
        self.assertEqual(0.999, rospy.get_param('/tracker/image/match_threshold'))
        with self.assertRaises(Exception):
            client.update_configuration({'no/such/setting': 1})
        self.assertEqual(TrackingState.TRACKING, self.run_images(5, 6)[-1].state)


if __name__ == '__main__':
    rospy.init_node('tracker_test')
    rostest.rosrun('active_matching_slam', 'tracker_test', TrackerTest, sys.argv)
