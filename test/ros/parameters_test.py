#!/usr/bin/env python3
"""Parameters that can't be right stop node and nodelet at start, by name."""

import subprocess
import sys
import unittest

import rospy
import rostest

NODE = ['rosrun', 'active_matching_slam', 'active_matching_slam_node']
NODELET = ['rosrun', 'nodelet', 'nodelet', 'standalone', 'active_matching_slam/TrackerNodelet']


class ParametersTest(unittest.TestCase):

    def start(self, program, parameters):
        """Exit status and output of a program that must end by itself."""
        name = 'refused'
        for key, value in parameters.items():
            rospy.set_param('/%s/%s' % (name, key), value)
        process = subprocess.Popen(program + ['__name:=' + name], stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, universal_newlines=True)
        try:
            output, _ = process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            self.fail('started in spite of %s' % parameters)
        finally:
            rospy.delete_param('/' + name)
        return process.returncode, output

    def check_refused(self, parameters, *words):
        status, output = self.start(NODE, parameters)
        self.assertEqual(2, status, output)
        for word in words:
            self.assertIn(word, output)

    def test_unknown_names(self):
        self.check_refused({'map/maximum_feature': 20}, 'unknown', '/refused/map/maximum_feature')
        self.check_refused({'mather': 'jcbb'}, 'unknown', '/refused/mather')

    def test_values_out_of_range(self):
        self.check_refused({'map/maximum_features': -3}, '/refused/map/maximum_features', '-3',
                           '[4, 5000]')
        self.check_refused({'filter/sigma_px': 1e9}, '/refused/filter/sigma_px')

    def test_values_of_the_wrong_type(self):
        self.check_refused({'filter/sigma_px': 'thick'}, '/refused/filter/sigma_px', 'thick')

    def test_names_that_are_no_matcher_mode_or_transport(self):
        self.check_refused({'matcher': 'magic'}, 'matcher', 'magic')
        self.check_refused({'tf_mode': 'sideways'}, 'tf_mode', 'sideways')
        self.check_refused({'image_transport': 'pigeon'}, 'image_transport', 'pigeon')

    def test_files_that_are_not_there(self):
        self.check_refused({'known_target': '/nonexistent/target.yaml'}, '/nonexistent/target.yaml')
        self.check_refused({'camera_info_url': 'file:///nonexistent/camera.yaml'},
                           '/nonexistent/camera.yaml')

    def test_frames_that_would_make_a_loop(self):
        self.check_refused({'world_frame': 'camera', 'camera_frame': 'camera'}, 'world_frame')
        self.check_refused({'tf_mode': 'map_to_odom'}, 'map_frame')

    def test_the_source_of_the_scale_is_said_at_start(self):
        process = subprocess.Popen(['stdbuf', '-oL'] + NODE + ['__name:=accepted'],
                                   stdout=subprocess.PIPE, universal_newlines=True)
        try:
            self.assertTrue(any('scale is free' in line for line in process.stdout))
        finally:
            process.terminate()
            process.communicate(timeout=30)

    def test_the_nodelet_refuses_as_the_node_does(self):
        status, output = self.start(NODELET, {'map/maximum_features': -3})
        self.assertNotEqual(0, status)
        self.assertIn('/refused/map/maximum_features', output)


if __name__ == '__main__':
    rospy.init_node('parameters_test')
    rostest.rosrun('active_matching_slam', 'parameters_test', ParametersTest, sys.argv)
