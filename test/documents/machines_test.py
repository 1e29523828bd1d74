#!/usr/bin/env python3
"""doc/several_machines.md tried out: three hosts, each in a network namespace, on one switch.

`robot` (10.0.0.1) runs the master and the camera, whose clock is wrong; `computer` (10.0.0.2) the
tracker; `viewer` (10.0.0.3) listens. Needs root and `ip`; skipped without.

AMS_TEST_BAG: a recording. AMS_PROGRAMS: where the built programs are.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
DOCUMENT = (SOURCE / 'doc' / 'several_machines.md').read_text(encoding='utf-8')
HOSTS = {'robot': '10.0.0.1', 'computer': '10.0.0.2', 'viewer': '10.0.0.3'}
CLOCK_ERROR_S = 3600.0
PATIENCE_S = 120


def ip(*words):
    subprocess.run(('ip', ) + words, check=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


class Network:
    """Hosts with one interface each, and a switch that joins them. All of it goes with close()."""

    def __init__(self):
        self.suffix = str(os.getpid())
        self.names = []
        try:
            self.build()
        except (OSError, subprocess.CalledProcessError):
            self.close()
            raise

    def build(self):
        self.add('switch')
        ip('-n', self.full('switch'), 'link', 'add', 'bridge', 'type', 'bridge')
        ip('-n', self.full('switch'), 'link', 'set', 'bridge', 'up')
        for host, address in HOSTS.items():
            self.add(host)
            ip('link', 'add', 'eth0', 'netns', self.full(host), 'type', 'veth', 'peer', 'name',
               'to_' + host, 'netns', self.full('switch'))
            ip('-n', self.full('switch'), 'link', 'set', 'to_' + host, 'master', 'bridge', 'up')
            ip('-n', self.full(host), 'addr', 'add', address + '/24', 'dev', 'eth0')
            ip('-n', self.full(host), 'link', 'set', 'eth0', 'up')
            ip('-n', self.full(host), 'link', 'set', 'lo', 'up')

    def full(self, host):
        return 'ams_%s_%s' % (host, self.suffix)

    def add(self, host):
        ip('netns', 'add', self.full(host))
        self.names.append(self.full(host))

    def close(self):
        for name in self.names:
            ip('netns', 'del', name)


def documented(program):
    """The commands of the document that begin with `program`, without comments."""
    lines = re.findall(r'^    (%s.*?)(?:\s+#.*)?$' % program, DOCUMENT, re.M)
    assert lines, 'the document has no ' + program
    return lines


class MachinesTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        try:
            cls.network = Network()
        except (OSError, subprocess.CalledProcessError) as error:
            raise unittest.SkipTest('skipped: no network namespaces here: %s' % error)
        cls.addClassCleanup(cls.network.close)
        cls.folder = tempfile.mkdtemp(prefix='ams_machines_')
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.started = []
        cls.addClassCleanup(cls.stop_all)
        subprocess.run([sys.executable, '-c', 'import os, sys; sys.path.insert(0, sys.argv[1]); '
                        'import harness; harness.compress_bag(os.environ["AMS_TEST_BAG"], '
                        'sys.argv[2], 100, float(sys.argv[3]))', str(SOURCE / 'test' / 'ros'),
                        cls.folder + '/robot.bag', str(CLOCK_ERROR_S)], check=True)
        cls.start('robot', 'roscore')
        cls.wait_for('viewer', 'rostopic list')
        cls.start('robot', 'rosbag play --quiet --loop --rate 0.5 robot.bag </dev/null')
        cls.start('computer', documented('roslaunch ')[0])

    @classmethod
    def environment(cls, host):
        """What the document says to set on each host, with the host's own address."""
        environment = dict(os.environ, PYTHONUNBUFFERED='1',
                           ROS_HOME='%s/%s' % (cls.folder, host))
        for name in ('ROS_IP', 'ROS_HOSTNAME'):
            environment.pop(name, None)
        for name, value in (line.split()[1].split('=') for line in documented('export ')):
            environment[name] = HOSTS[host] if name == 'ROS_IP' else value
        return environment

    @classmethod
    def command(cls, host, command):
        return ['ip', 'netns', 'exec', cls.network.full(host), 'bash', '-c', command]

    @classmethod
    def start(cls, host, command):
        with open('%s/%s.log' % (cls.folder, host), 'a') as log:
            cls.started.append(subprocess.Popen(
                cls.command(host, 'exec ' + command), cwd=cls.folder, env=cls.environment(host),
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True))

    @classmethod
    def stop_all(cls):
        for process in reversed(cls.started):
            os.killpg(process.pid, signal.SIGINT)
            try:
                process.wait(30)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()

    @classmethod
    def run_on(cls, host, command, seconds=30):
        """Exit status and output; commands that never end are interrupted."""
        done = subprocess.run(cls.command(host, 'timeout -s INT %d %s' % (seconds, command)),
                              cwd=cls.folder, env=cls.environment(host), stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              universal_newlines=True)
        return done.returncode, done.stdout

    @classmethod
    def wait_for(cls, host, command):
        end = time.time() + PATIENCE_S
        while cls.run_on(host, command)[0] != 0:
            if time.time() > end:
                raise AssertionError('never succeeded on %s: %s' % (host, command))
            threading.Event().wait(0.3)

    def test_the_camera_is_tracked_elsewhere_and_seen_by_a_third(self):
        self.wait_for('viewer', "rostopic echo -n 1 --filter 'm.state == 2' /tracker/state")
        # Stamps are the robot's clock's: its error changes nothing.
        _, pose = self.run_on('viewer', 'rostopic echo -n 1 /tracker/pose/header/stamp')
        self.assertGreater(int(re.search(r'secs: (\d+)', pose).group(1)), CLOCK_ERROR_S)

    def test_the_check_from_the_bottom_up(self):
        self.wait_for('viewer', "rostopic echo -n 1 --filter 'm.state == 2' /tracker/state")
        if shutil.which('ping'):
            self.assertEqual(0, self.run_on('viewer', documented('ping ')[0] + ' -c 1')[0])
        for command in documented('rosnode '):
            self.assertIn('ping average', self.run_on('viewer', command)[1])
        for command in documented('rostopic hz'):
            host = 'computer' if 'image' in command else 'viewer'
            self.assertIn('average rate', self.run_on(
                host, command + ' | grep -m 1 "average rate"', PATIENCE_S)[1], command)
        for command in documented('rostopic echo'):
            self.assertEqual(0, self.run_on('viewer', command)[0], command)

    def test_the_latency_tells_of_the_clocks(self):
        _, diagnostics = self.run_on(
            'viewer', 'rostopic echo -n 2 /diagnostics')
        told = re.findall(r'latency from stamp, mean \[ms\]"\s+value: "([-\d.]+)"', diagnostics)
        own = re.findall(r'time in this node, mean \[ms\]"\s+value: "([-\d.]+)"', diagnostics)
        self.assertTrue(told and own, diagnostics)
        self.assertGreater(abs(float(told[-1])), 1000.0 * 60)
        self.assertLess(float(own[-1]), 1000.0 * 10)

    def test_without_ros_ip_topics_are_listed_but_silent(self):
        """The trouble the document names, so that its remedy is known to be one."""
        environment = self.environment('robot')
        environment.pop('ROS_IP')
        environment['ROS_HOSTNAME'] = 'robot-that-nobody-resolves'
        silent = subprocess.Popen(
            self.command('robot', 'exec rostopic pub -r 10 /silent std_msgs/String hello'),
            env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL, start_new_session=True)
        try:
            self.wait_for('viewer', 'rostopic list | grep -q /silent')
            self.assertNotIn('hello', self.run_on('viewer', 'rostopic echo -n 1 /silent', 4)[1])
        finally:
            os.killpg(silent.pid, signal.SIGINT)
            silent.wait()


if __name__ == '__main__':
    unittest.main(argv=sys.argv, verbosity=2)
