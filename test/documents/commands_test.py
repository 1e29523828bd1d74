#!/usr/bin/env python3
"""Runs every command of the README and doc/: what stands there works as it stands there.

A command is a line of an indented block, or text in backquotes, that begins with one of PROGRAMS.
Each has a recipe below that says how it is run here; a command without one fails the test. Recipes
run against a camera (a recording over and over), a tracker, and a master of their own. What needs a
screen is skipped where rviz and Xvfb are not installed.

AMS_PROGRAMS: where the built programs are. AMS_TEST_BAG: the recording. AMS_BUILT: the build folder.
"""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
PACKAGE = 'active_matching_slam'
BAG = os.environ['AMS_TEST_BAG']
BUILT = os.environ['AMS_BUILT']
PROGRAMS = ('scripts/', 'roslaunch ', 'rosrun ', 'rosservice ', 'rostopic ', 'rosbag ', 'rosnode ',
            'track_bag ', 'export ', 'ping ', 'ntpdate ')
PATIENCE_S = 120


def commands():
    """(document, command) of all documents, without comments, in order."""
    found = []
    for document in [SOURCE / 'README.md'] + sorted((SOURCE / 'doc').rglob('*.md')):
        text = document.read_text(encoding='utf-8').replace('\\\n', ' ')
        blocks = re.findall(r'^    (.*)$', text, re.M)
        inline = re.findall(r'`([^`\n]+)`', text)
        for line in blocks + inline:
            line = re.sub(r'\s+#.*', '', line).strip()
            if line.startswith(PROGRAMS) and ' ' in line or line.startswith('scripts/'):
                found.append((document.name, re.sub(r'\s+', ' ', line)))
    return found


def free_port():
    with socket.socket() as s:
        s.bind(('127.0.0.1', 0))
        return s.getsockname()[1]


class Shell:
    """A folder with what the documents assume to be there, and an environment to run in."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.started = []
        self.log = open(str(self.folder / 'log.txt'), 'w+')
        self.environment = dict(os.environ, ROS_HOME=str(self.folder / 'ros_home'),
                                PYTHONUNBUFFERED='1',
                                PATH=os.environ['AMS_PROGRAMS'] + ':' + os.environ['PATH'],
                                PYTHONPATH='%s:%s' % (SOURCE / 'test' / 'ros',
                                                      os.environ.get('PYTHONPATH', '')))
        for name in ('ROS_IP', 'ROS_HOSTNAME'):
            self.environment.pop(name, None)
        shutil.copy(BAG, str(self.folder / 'desk.bag'))
        stem = BAG[:-len('.bag')]
        shutil.copy(stem + '.camera.yaml', str(self.folder / 'camera.yaml'))
        (self.folder / 'mine.yaml').write_text('filter: {sigma_px: 1.0}\n')
        self.run('python3 -c "import harness, numpy; open(\'mask.png\', \'wb\').write(harness.png('
                 'numpy.pad(numpy.full((200, 320), 255), ((0, 40), (0, 0)))))"')
        (self.folder / 'ros_home' / PACKAGE).mkdir(parents=True)
        self.run('track_bag --bag desk.bag --output mapped && cp mapped/final.map desk.map && '
                 'cp desk.map ros_home/%s/' % PACKAGE)

    def start(self, command):
        process = subprocess.Popen(['bash', '-c', 'exec ' + command], cwd=str(self.folder),
                                   env=self.environment, stdin=subprocess.DEVNULL, stdout=self.log,
                                   stderr=subprocess.STDOUT, start_new_session=True)
        self.started.append(process)
        return process

    def stop(self, process):
        for number, patience in ((signal.SIGINT, 60), (signal.SIGKILL, 10)):
            if process.poll() is None:
                os.killpg(process.pid, number)
            try:
                process.wait(patience)
                break
            except subprocess.TimeoutExpired:
                pass
        self.started.remove(process)

    def close(self):
        for process in reversed(list(self.started)):
            self.stop(process)
        self.log.close()

    def run(self, command, check=True):
        """Its output; what it says on the way to a fault is in the failure's text."""
        done = subprocess.run(['bash', '-c', command], cwd=str(self.folder), env=self.environment,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, timeout=PATIENCE_S + 60,
                              universal_newlines=True)
        if check and done.returncode != 0:
            raise AssertionError('%s: status %d\n%s' % (command, done.returncode, done.stdout))
        return done.stdout

    # A graph of its own ---------------------------------------------------------------------

    def new_master(self):
        self.environment['ROS_MASTER_URI'] = 'http://localhost:%d' % free_port()

    def start_master(self):
        self.new_master()
        self.start('roscore -p ' + self.environment['ROS_MASTER_URI'].rsplit(':', 1)[1])
        self.wait_for('rostopic list')

    def wait_for(self, command):
        """Until it succeeds."""
        end = time.time() + PATIENCE_S
        while subprocess.run(['bash', '-c', 'timeout 20 ' + command], cwd=str(self.folder),
                             env=self.environment, stdin=subprocess.DEVNULL,
                             stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode:
            if time.time() > end:
                self.log.flush()
                raise AssertionError('never succeeded: %s\n%s' % (
                    command, Path(self.log.name).read_text(errors='replace')[-3000:]))
            time.sleep(0.3)

    def wait_until_tracking(self):
        self.wait_for("rostopic echo -n 1 --filter 'm.state == 2' /tracker/state | grep -q state")

    def start_camera(self, topics=''):
        self.start('rosbag play --quiet --loop --rate 0.5 desk.bag %s </dev/null' % topics)


class CommandsTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.mkdtemp(prefix='ams_commands_')
        cls.shell = Shell(cls.folder)
        cls.ran = set()

    @classmethod
    def tearDownClass(cls):
        cls.shell.close()
        shutil.rmtree(cls.folder)

    def run_documented(self, pattern, recipe):
        """Applies `recipe(command)` to every documented command that the pattern matches."""
        matching = [c for c in dict.fromkeys(c for _, c in commands()) if re.fullmatch(pattern, c)]
        self.assertTrue(matching, 'no document has: ' + pattern)
        for command in matching:
            with self.subTest(command=command):
                recipe(command)

    # -- offline -------------------------------------------------------------------------------

    def test_tracking_of_a_bag(self):
        def track(command):
            shutil.rmtree(self.folder + '/desk', ignore_errors=True)
            output = self.shell.run(command)
            folder = re.search(r'--output (\S+)', command).group(1)
            for name in ('trajectory.txt', 'statistics.csv', 'summary.json'):
                self.assertTrue((Path(self.folder) / folder / name).is_file(), output)
        self.run_documented(SIMULATE_BAG, self.shell.run)  # what some of them track
        self.run_documented(TRACK_BAG, track)

    def test_images_and_a_video_become_a_bag(self):
        self.shell.run('mkdir -p frames && python3 - <<"END"\n' + MAKE_FRAMES + 'END\n')

        def convert(command):
            os.rename(self.folder + '/desk.bag', self.folder + '/kept.bag')
            try:
                self.shell.run(command.replace('scripts/', '%s/scripts/' % SOURCE))
                info = self.shell.run('rosbag info desk.bag')
                self.assertIn('/camera/image_raw', info)
                self.assertIn('/camera/camera_info', info)
            finally:
                os.replace(self.folder + '/kept.bag', self.folder + '/desk.bag')
        self.run_documented(IMAGES_TO_BAG, convert)

    def test_help_of_every_tool(self):
        def ask(command):
            for path in sorted((SOURCE / 'src' / 'tools').glob('*.cpp')):
                self.assertTrue(self.shell.run(command.replace('TOOL', path.stem)).strip())
        self.run_documented(TOOL_HELP, ask)
        self.run_documented(r'scripts/images_to_bag --help', lambda command: self.assertIn(
            '--camera-info', self.shell.run('%s/%s' % (SOURCE, command))))

    def test_plot_of_a_benchmark(self):
        if not (Path(os.environ['AMS_PROGRAMS']) / 'information_benchmark').exists():
            self.skipTest('skipped: built without Google Benchmark')

        def plot(command):
            self.shell.run('%s/%s --benchmark_min_time=0.01' % (SOURCE, command))
            self.assertTrue((Path(self.folder) / 'plot.png').is_file())
        self.run_documented(PLOT_BENCHMARK, plot)

    def test_demo(self):
        if not shutil.which('rviz') or not shutil.which('Xvfb'):
            self.skipTest('skipped: rviz and Xvfb are not installed')
        shown = set()

        def show(command):  # the same bag for those that name one, and for those that render theirs
            done = re.sub(r' (BAG|desk\.bag|--headless)', '', command) + ' desk.bag --headless'
            if done not in shown:
                shown.add(done)
                # As on a computer that does not know its own name.
                output = self.shell.run('ROS_HOSTNAME=nowhere.invalid %s/%s --built %s --output demo' %
                                        (SOURCE, done, BUILT))
                self.assertIn("doesn't know its own name 'nowhere.invalid'", output)
                self.assertIn('demo/trajectory.png', output)
                self.assertIn('demo/rviz.png', output)
        self.run_documented(DEMO, show)

    # -- against a running tracker ---------------------------------------------------------------

    def test_commands_beside_a_running_tracker(self):
        self.shell.start_master()
        self.shell.start('rosrun %s %s_node __name:=tracker image:=/camera/image_raw' %
                         (PACKAGE, PACKAGE))
        self.shell.start_camera()
        self.shell.wait_until_tracking()
        self.addCleanup(lambda: [self.shell.stop(p) for p in list(self.shell.started)])

        def watch(command):  # those that go on until Ctrl-C
            if command.endswith('/compressed'):
                return  # in machines_test.py, where there is such a camera
            self.assertIn('average rate', self.shell.run(
                'timeout %d %s | grep -m 1 "average rate"' % (PATIENCE_S, command)))
        self.run_documented(r'rostopic hz .*', watch)

        def ask(command):
            self.assertIn('---', self.shell.run('timeout %d %s' % (PATIENCE_S, command)))
        self.run_documented(r'rostopic echo -n 1 .*', ask)
        self.run_documented(r'rosservice call .*', lambda command: self.assertIn(
            'success: True', self.shell.run(command)))
        self.run_documented(r'rosnode ping .*', lambda command: self.assertIn(
            'ping average', self.shell.run(command)))
        self.run_documented(r'rosrun dynamic_reconfigure .*', self.shell.run)

        def record(command):
            os.rename(self.folder + '/desk.bag', self.folder + '/kept.bag')
            try:
                recorder = self.shell.start(command)
                self.shell.wait_for('test "$(stat -c %s desk.bag.active)" -gt 500000')
                self.shell.stop(recorder)
                self.assertIn('/camera/image_raw', self.shell.run('rosbag info desk.bag'))
            finally:
                os.replace(self.folder + '/kept.bag', self.folder + '/desk.bag')
        self.run_documented(r'rosbag record .*', record)

    # -- launch files ----------------------------------------------------------------------------

    def test_launch_files(self):
        def launch(command):
            self.shell.new_master()
            port = self.shell.environment['ROS_MASTER_URI'].rsplit(':', 1)[1]
            # Those that would open a window: see test_demo.
            if 'rviz:=' in command or 'play_bag' in command or 'demo.launch' in command:
                command = re.sub(r' rviz:=\w+', '', command) + ' rviz:=false'
            self.shell.start(command.replace('roslaunch', 'roslaunch -p ' + port))
            self.shell.wait_for('rosparam get /run_id')
            if 'manager:=' in command:
                self.shell.start('rosrun nodelet nodelet manager __ns:=/camera __name:=manager')
            if 'compressed' in command:
                self.shell.run('python3 -c "import harness; harness.compress_bag(\'desk.bag\', '
                               '\'compressed.bag\', 60)"')
                self.shell.start('rosbag play --quiet --loop --rate 0.5 compressed.bag </dev/null')
            elif re.search(r'tracker\.launch|wheeled_base\.launch|drone\.launch', command):
                self.shell.start_camera()
            self.shell.wait_until_tracking()
            for process in reversed(list(self.shell.started)):
                self.shell.stop(process)
        self.run_documented(LAUNCH, launch)

    # -- none is left out ------------------------------------------------------------------------

    def test_every_command_has_a_recipe(self):
        for document, command in commands():
            self.assertTrue(any(re.fullmatch(pattern, command) for pattern in RECIPES),
                            '%s: nothing runs: %s' % (document, command))


TRACK_BAG = r'(rosrun %s )?track_bag .*' % PACKAGE
IMAGES_TO_BAG = r'scripts/images_to_bag --images .+'
SIMULATE_BAG = r'rosrun %s simulate_bag .*' % PACKAGE
TOOL_HELP = r'rosrun %s TOOL --help' % PACKAGE
DEMO = r'scripts/demo( BAG| desk\.bag| --headless)'
LAUNCH = r'roslaunch .*'
PLOT_BENCHMARK = r'scripts/plot_benchmark .*'
RECIPES = [
    TRACK_BAG, SIMULATE_BAG, IMAGES_TO_BAG, TOOL_HELP, DEMO, LAUNCH, PLOT_BENCHMARK, r'rostopic hz .*',
    r'rostopic echo -n 1 .*', r'rosservice call .*', r'rosnode ping .*',
    r'rosrun dynamic_reconfigure .*', r'rosbag record .*',
    # Run by whoever runs this test, or part of what runs above.
    r'scripts/(build|test|demo|images_to_bag)( && source build/release/devel/setup\.bash| --help)?',
    r'scripts/test --.*', r'rosbag play --clock', r'rostopic (list|echo)',
    # Hours of work; tried in small in test/tools/reproduce_test.cpp.
    r'rosrun %s reproduce .*' % PACKAGE, r'rosrun %s reliability' % PACKAGE,
    r'rosrun %s consistency' % PACKAGE, r'scripts/update_.*',
    r'scripts/odometry_from_truth',  # needs a recording's truth
    r'scripts/compare_runs .*',  # in small in test/tools/compare_runs_test.py
    # Run in machines_test.py.
    r'export ROS_.*', r'ping .*',
    # Made, installed and run on bare systems by .github/workflows/ci.yml.
    r'scripts/package',
    # For people with a board in the hand, another computer, or a screen.
    r'rosrun camera_calibration .*', r'ntpdate -q .*', r'rosrun image_view .*']

MAKE_FRAMES = '''
import harness
with open('times.txt', 'w') as times, open('phone.mp4', 'wb') as video:
    recording = harness.Recording('desk.bag')
    # Uncompressed video: what tells is the content, not the name.
    width, height = recording.info.width, recording.info.height
    video.write(b'YUV4MPEG2 W%d H%d F30:1 Ip C420jpeg\\n' % (width, height))
    for i, image in enumerate(recording.images[:20]):
        pixels = harness.pixels_of(image).astype('uint8')
        with open('frames/%06d.png' % i, 'wb') as frame:
            frame.write(harness.png(pixels))
        stamp = image.header.stamp
        times.write('%d.%09d %06d.png\\n' % (stamp.secs, stamp.nsecs, i))
        video.write(b'FRAME\\n' + pixels.tobytes() + bytes([128]) * (width * height // 2))
'''

if __name__ == '__main__':
    unittest.main(argv=sys.argv, verbosity=2)
