#!/usr/bin/env python3
"""rosrun finds every program exactly once, and asks nothing, however the package was built.

Configures copies of the package as scripts/build and catkin_make do, without compiling: what counts
is where programs are, not what they do. AMS_PROGRAMS: where those of this build are.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
PACKAGE = 'active_matching_slam'
PROGRAMS = [path.stem for folder in ('src/tools', 'src/ros/node')
            for path in sorted((SOURCE / folder).glob('*.cpp'))]
IN_DEVEL = Path('lib') / PACKAGE


def environment():
    """This one, without the package."""
    cleared = dict(os.environ)
    cleared.pop('ROS_PACKAGE_PATH', None)
    spaces = [space for space in cleared.pop('CMAKE_PREFIX_PATH', '').split(':')
              if space and not os.environ['AMS_PROGRAMS'].startswith(space + '/lib')]
    if spaces:
        cleared['CMAKE_PREFIX_PATH'] = ':'.join(spaces)
    return cleared


def run(*command):
    done = subprocess.run(command, env=environment(), stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
    if done.returncode != 0:
        raise AssertionError('%s: status %d\n%s' % (command, done.returncode, done.stdout))
    return done.stdout


def configure(source, build, devel):
    run('cmake', '-S', str(source), '-B', str(build), '-DCATKIN_DEVEL_PREFIX=%s' % devel,
        '-DCATKIN_ENABLE_TESTING=OFF', '-DPYTHON_EXECUTABLE=/usr/bin/python3',
        '-DPython3_EXECUTABLE=/usr/bin/python3')


def make_programs(devel):
    folder = devel / IN_DEVEL
    folder.mkdir(parents=True, exist_ok=True)
    for name in PROGRAMS:
        (folder / name).write_text('')
        (folder / name).chmod(0o755)


class RosrunTest(unittest.TestCase):

    def setUp(self):
        self.folder = Path(tempfile.mkdtemp(prefix='ams_rosrun_')).resolve()
        self.addCleanup(shutil.rmtree, str(self.folder))

    def copy_package(self, to):
        """With what building for tests inside the package would leave there."""
        to.mkdir(parents=True)
        for path in SOURCE.iterdir():
            if path.is_file():
                shutil.copy(str(path), str(to))
            elif path.name[0] != '.' and not path.name.startswith(('build', 'demo_')):
                shutil.copytree(str(path), str(to / path.name))
        make_programs(to / 'build' / 'test' / 'devel')

    def check(self, devel):
        make_programs(devel)
        found = run('bash', '-c', 'source %s/setup.bash; for program in %s; do '
                    'rosrun --prefix echo %s $program; done' % (devel, ' '.join(PROGRAMS), PACKAGE))
        self.assertEqual([str(devel / IN_DEVEL / name) for name in PROGRAMS], found.split())

    def test_rosrun_finds_each_program_once_where_the_package_is_built_inside_itself(self):
        package = self.folder / PACKAGE
        self.copy_package(package)
        build = package / 'build' / 'release'
        configure(package, build, build / 'devel')
        self.check(build / 'devel')

    def test_rosrun_finds_each_program_once_in_a_workspace(self):
        source = self.folder / 'src'
        self.copy_package(source / PACKAGE)
        run('catkin_init_workspace', str(source))
        configure(source, self.folder / 'build', self.folder / 'devel')
        self.check(self.folder / 'devel')


if __name__ == '__main__':
    unittest.main(argv=sys.argv, verbosity=2)
