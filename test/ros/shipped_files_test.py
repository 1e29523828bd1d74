#!/usr/bin/env python3
"""Every launch, yaml and rviz file of the package can be loaded and speaks of what exists."""

import glob
import os
import shutil
import sys
import unittest
from xml.etree import ElementTree

import roslaunch
import rospy
import rostest
import yaml

from active_matching_slam.msg import TrackingState
import harness

PACKAGE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.realpath(__file__))))


class ShippedFilesTest(unittest.TestCase):

    def files(self, pattern):
        found = sorted(glob.glob(os.path.join(PACKAGE, pattern)))
        self.assertTrue(found, pattern)
        return found

    def load(self, path, **arguments):
        loader = roslaunch.xmlloader.XmlLoader()
        config = roslaunch.config.ROSLaunchConfig()
        loader.load(path, config, argv=['%s:=%s' % item for item in arguments.items()],
                    verbose=False)
        return config

    def test_launch_files(self):
        for path in self.files('launch/*.launch'):
            arguments = {} if path.endswith('tracker.launch') else {'bag': '/tmp/some.bag'}
            for rviz in ('true', 'false'):
                config = self.load(path, rviz=rviz, **arguments)
                programs = {node.type: node for node in config.nodes}
                self.assertTrue({'active_matching_slam_node', 'nodelet'} & set(programs), path)
                self.assertEqual(rviz == 'true', 'rviz' in programs, path)
                for node in config.nodes:
                    if node.type == 'rviz' and not shutil.which('rviz'):
                        continue  # tests install no viewer
                    if node.package == 'robot_localization':
                        continue  # Debian has no package of it
                    self.assertTrue(roslaunch.node_args.create_local_process_args(
                        node, config.machines.get('', next(iter(config.machines.values())))),
                                    node.type)
            if 'rviz' in programs:
                view = programs['rviz'].args.split()[1]
                self.assertTrue(os.path.isfile(view), view)

    def test_rviz_shows_a_frame_that_is_sent_and_the_topics_of_its_tracker(self):
        path = self.files('launch/tracker.launch')[0]
        for given, sent in (({}, 'map'), ({'map_frame': 'floor'}, 'floor'),
                            ({'tf_mode': 'none', 'world_frame': 'room'}, 'room')):
            config = self.load(path, rviz='true', **given)
            view = [node for node in config.nodes if node.type == 'rviz'][0]
            self.assertEqual(['-f', sent], view.args.split()[2:], given)
            if 'tf_mode' not in given:
                self.assertEqual(sent, config.params['/tracker/map_frame'].value)
        self.assertEqual('', self.load(path).params['/tracker/map_frame'].value)
        named = self.load(path, rviz='true', name='left')
        view = [node for node in named.nodes if node.type == 'rviz'][0]
        remapped = dict(view.remap_args)
        for topic in self.topics_shown('rviz/tracker.rviz'):
            self.assertEqual(topic.replace('/tracker/', '/left/'), remapped[topic])

    def test_the_panel_of_the_view_is_exported_and_follows_the_name(self):
        with open(os.path.join(PACKAGE, 'rviz/tracker.rviz')) as file:
            panels = yaml.safe_load(file)['Panels']
        panel = [p for p in panels if p['Class'].startswith('active_matching_slam/')][0]
        exported = ElementTree.parse(os.path.join(PACKAGE, 'rviz_plugins.xml')).findall('class')
        self.assertEqual([panel['Class']], [plugin.get('name') for plugin in exported])
        named = self.load(self.files('launch/tracker.launch')[0], rviz='true', name='left')
        view = [node for node in named.nodes if node.type == 'rviz'][0]
        self.assertEqual('/left', dict(view.remap_args)[panel['Tracker']])

    def topics_shown(self, path):
        with open(os.path.join(PACKAGE, path)) as file:
            displays = yaml.safe_load(file)['Visualization Manager']['Displays']
        return [value for display in displays for key, value in display.items()
                if key in ('Image Topic', 'Marker Topic', 'Topic')]

    def test_launch_files_default_to_the_topics_of_the_tools(self):
        config = self.load(self.files('launch/tracker.launch')[0])
        remapped = dict(config.nodes[0].remap_args)
        self.assertEqual('/camera/image_raw', remapped['image'])
        self.assertEqual('/camera/camera_info', remapped['camera_info'])

    def test_nodelet_in_a_manager_or_alone(self):
        path = self.files('launch/tracker.launch')[0]
        alone = self.load(path, nodelet='true').nodes[0]
        self.assertIn('standalone active_matching_slam/TrackerNodelet', alone.args)
        managed = self.load(path, nodelet='true', manager='camera_manager').nodes[0]
        self.assertIn('load active_matching_slam/TrackerNodelet camera_manager', managed.args)

    def test_settings_are_those_of_the_node(self):
        """The tracker of this test was started with all of them and would have refused others."""
        state = harness.Inbox('/tracker/state', TrackingState)
        self.assertIsNotNone(state.wait_for(lambda message: message.state_name == 'waiting'))
        for path in self.files('config/*.yaml'):
            with open(path) as file:
                for key, value in yaml.safe_load(file).items():
                    for name in ([key] if not isinstance(value, dict) else
                                 [key + '/' + member for member in value]):
                        self.assertTrue(rospy.has_param('/tracker/' + name), name)

    def test_views_show_topics_of_the_node(self):
        harness.wait_until(lambda: any('/tracker/debug_image' in topic
                                       for topic, _ in rospy.get_published_topics()),
                           what='topics of the tracker')
        topics = dict(rospy.get_published_topics())
        for path in self.files('rviz/*.rviz'):
            shown = self.topics_shown(path)
            self.assertGreater(len(shown), 4, path)
            for topic in shown:
                self.assertIn(topic, topics, path)


if __name__ == '__main__':
    rospy.init_node('shipped_files_test')
    rostest.rosrun('active_matching_slam', 'shipped_files_test', ShippedFilesTest, sys.argv)
