#!/usr/bin/env python3
"""The plan of the house: a file includes only from its own room and from lower floors.

Header-only includes count like any others, and nothing below the ROS layer includes a ROS header.
"""
import re
import unittest
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGE = "active_matching_slam"

FLOORS = [
    {"math"},
    {"camera", "information"},
    {"matching", "filter", "simulation"},
    {"image", "initialisation", "submaps"},
    {"map"},
    {"tracker"},
    {"visualisation"},
    {"ros", "evaluation"},
    {"experiments", "rviz_panel"},
    {"tools"},
]
FLOOR_OF = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}
WITH_ROS = {"ros", "rviz_panel", "tools"}
ROS_HEADER = re.compile(
    r"<(ros|roscpp|nodelet|pluginlib|cv_bridge|image_transport|camera_info_manager|rosbag|"
    r"dynamic_reconfigure|diagnostic_updater|tf2\w*|\w+_msgs|std_srvs|topic_tools)/"
)


def source_files():
    for folder in (REPOSITORY / "src", REPOSITORY / "include" / PACKAGE):
        for path in sorted(folder.rglob("*")):
            if path.suffix in {".h", ".hpp", ".cpp"}:
                yield path.relative_to(folder).parts[0], path


def includes(path):
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        match = re.match(r'\s*#\s*include\s*([<"][^>"]+[>"])', line)
        if match:
            yield number, match.group(1)


def room_included(path, name, room):
    """The room of this package that an include leads to; None for another library's."""
    if name.startswith("<") and not name.startswith("<" + PACKAGE):
        return None
    name = name.strip('<>"')
    if name.startswith(PACKAGE + "/"):
        parts = Path(name).parts
        return parts[1] if len(parts) > 2 else None  # a generated message
    for base in (path.parent, REPOSITORY / "src" / room, REPOSITORY / "src"):
        beside = (base / name).resolve()
        if beside.exists():
            source = (REPOSITORY / "src").resolve()
            return beside.relative_to(source).parts[0] if source in beside.parents else room
    return None


class IncludeGraph(unittest.TestCase):
    def test_every_room_has_a_floor(self):
        rooms = {room for room, _ in source_files()}
        self.assertEqual(rooms, set(FLOOR_OF), "rooms of src/ and include/, and those of the plan")

    def test_includes_run_down(self):
        wrong = []
        for room, path in source_files():
            for number, name in includes(path):
                other = room_included(path, name, room)
                if other in (None, room):
                    continue
                if other not in FLOOR_OF or FLOOR_OF[other] >= FLOOR_OF[room]:
                    wrong.append(f"{path.relative_to(REPOSITORY)}:{number} includes {name}")
        self.assertEqual(wrong, [])

    def test_the_core_includes_no_ros(self):
        wrong = [
            f"{path.relative_to(REPOSITORY)}:{number} includes {name}"
            for room, path in source_files()
            if room not in WITH_ROS
            for number, name in includes(path)
            if ROS_HEADER.match(name)
        ]
        self.assertEqual(wrong, [])


if __name__ == "__main__":
    unittest.main()
