#!/usr/bin/env python3
"""Holds the documents to what the package has: links, scripts, launch files, tools, parameters."""

import functools
import os
import re
import subprocess
import sys
import unittest
import xml.etree.ElementTree as ElementTree
from pathlib import Path

PACKAGE = "active_matching_slam"
SOURCE = Path(__file__).resolve().parents[2]
PROGRAMS = Path(os.environ.get("AMS_PROGRAMS", ""))  # where the built tools are
DOCUMENTS = [SOURCE / "README.md"] + sorted((SOURCE / "doc").rglob("*.md"))


def lines():
    """(place, line) of every document, commands continued by a backslash as one line."""
    for document in DOCUMENTS:
        text = document.read_text(encoding="utf-8").replace("\\\n", " ")
        for number, line in enumerate(text.splitlines(), 1):
            yield "{}:{}".format(document.name, number), line


def run(program, *arguments):
    return subprocess.run([str(PROGRAMS / program), *arguments], check=True, timeout=60,
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                          universal_newlines=True).stdout


@functools.lru_cache(maxsize=None)
def options(tool):
    return set(re.findall(r"(--[a-z][\w-]*)", run(tool, "--help")))


@functools.lru_cache(maxsize=None)
def names_of_tests():
    tests = "".join(path.read_text(encoding="utf-8") for pattern in ("*.py", "*.cpp")
                    for path in sorted((SOURCE / "test").rglob(pattern)))
    cpp = re.findall(r"^TEST(?:_[FP])?\((\w+), (\w+)\)", tests, re.M)
    return set(re.findall(r"def (test_\w+)\(", tests)) | {".".join(name) for name in cpp}


def anchor(heading):
    """As GitHub makes it."""
    kept = re.sub(r"[^\w\- ]", "", heading.strip().lower())
    return kept.replace(" ", "-")


class Documents(unittest.TestCase):
    def test_every_link_leads_somewhere(self):
        for document in DOCUMENTS:
            for link in re.findall(r"\]\(([^)\s]+)\)", document.read_text(encoding="utf-8")):
                if link.startswith("http"):
                    continue
                path, _, fragment = link.partition("#")
                target = (document.parent / path) if path else document
                self.assertTrue(target.exists(), "{}: no {}".format(document.name, link))
                if fragment:
                    headings = re.findall(r"^#+ (.*)$", target.read_text(encoding="utf-8"), re.M)
                    self.assertIn(fragment, map(anchor, headings), document.name)

    def test_lines_of_text_are_at_most_120_columns_long(self):
        for document in DOCUMENTS:
            for number, line in enumerate(document.read_text(encoding="utf-8").splitlines(), 1):
                self.assertTrue(len(line) <= 120 or line.startswith(("|", "![")),
                                "{}:{}".format(document.name, number))

    def test_every_script_named_exists(self):
        for place, line in lines():
            for name in re.findall(r"\bscripts/(\w+)", line):
                self.assertTrue(os.access(str(SOURCE / "scripts" / name), os.X_OK),
                                "{}: no scripts/{}".format(place, name))

    def test_every_launch_file_named_exists_and_has_the_arguments_given(self):
        for place, line in lines():
            for name in re.findall(r"\b(\w+\.launch)\b", line):
                self.assertTrue((SOURCE / "launch" / name).exists(), "{}: {}".format(place, name))
            command = re.search(r"roslaunch " + PACKAGE + r" (\w+\.launch)([^#`]*)", line)
            if command:
                launch = ElementTree.parse(str(SOURCE / "launch" / command.group(1))).getroot()
                known = {argument.get("name") for argument in launch.findall("arg")}
                given = set(re.findall(r"(\w+):=", command.group(2)))
                self.assertLessEqual(given, known, place)

    def test_every_argument_of_the_tracker_can_be_given_to_the_other_launch_files(self):
        def arguments(name):
            launch = ElementTree.parse(str(SOURCE / "launch" / name)).getroot()
            return {argument.get("name") for argument in launch.findall("arg")}
        for name in ("play_bag.launch", "demo.launch"):
            # Those with a value of the launch file's own are none of the user's.
            missing = arguments("tracker.launch") - arguments(name) - {"shown_frame"}
            self.assertFalse(missing, name)

    def test_every_tool_named_exists_and_has_the_options_given(self):
        tools = {path.stem for path in (SOURCE / "src" / "tools").glob("*.cpp")}
        for place, line in lines():
            for tool in re.findall(r"rosrun " + PACKAGE + r" (\w+)", line):
                self.assertIn(tool, tools | {"TOOL"}, place)
            for tool, rest in re.findall(r"\b(" + "|".join(tools) + r")((?: [^#`]*)?)", line):
                given = set(re.findall(r"(--[a-z][\w-]*)", rest))
                if given:
                    self.assertLessEqual(given, options(tool), "{}: {}".format(place, tool))

    def test_every_topic_and_service_in_the_tables_is_advertised(self):
        code = "".join(path.read_text(encoding="utf-8")
                       for path in sorted((SOURCE / "src" / "ros").glob("*.cpp")))
        for name in re.findall(r"`~([\w/]+)`", (SOURCE / "README.md").read_text(encoding="utf-8")):
            self.assertIn('"{}"'.format(name.split("/")[-1]), code, "~" + name)

    def test_every_test_named_exists(self):
        troubles = (SOURCE / "doc" / "known_troubles.md").read_text(encoding="utf-8")
        named = re.findall(r"`(test_\w+|[A-Z]\w+\.[A-Z]\w+)`", troubles)
        self.assertGreater(len(named), 40)
        for name in named:
            self.assertIn(name, names_of_tests())

    def test_the_table_of_parameters_is_what_the_program_prints(self):
        readme = (SOURCE / "README.md").read_text(encoding="utf-8")
        table = readme.split("<!-- parameter_table -->\n")[1].split("<!-- end -->")[0]
        self.assertEqual(table, run("parameter_table"), "run scripts/update_parameter_table")

    def test_every_parameter_named_exists(self):
        known = set(re.findall(r"^\| `([\w/]+)` \|", run("parameter_table"), re.M))
        groups = {name.split("/")[0] for name in known if "/" in name}
        for place, line in lines():
            for name in re.findall(r"`((?:" + "|".join(groups) + r")/\w+)`", line):
                self.assertIn(name, known, place)


class Theory(unittest.TestCase):
    """Each page of doc/theory that ends with constants: its size, and that what these say is true."""

    PAGES = [path for path in sorted((SOURCE / "doc" / "theory").glob("*.md"))
             if "## Constants" in path.read_text(encoding="utf-8")]

    @staticmethod
    def number(text):
        """Of a literal or a fraction; None for anything else."""
        parts = text.strip().rstrip("f").replace("'", "").split("/")
        try:
            numbers = [float(part) for part in parts]
        except ValueError:
            return None
        return numbers[0] / numbers[1] if len(numbers) == 2 else numbers[0]

    @classmethod
    def rows(cls):
        for page in cls.PAGES:
            table = page.read_text(encoding="utf-8").split("## Constants")[1]
            for name, value, test in re.findall(
                    r"^\| `([\w/]+)` \| ([^|]*) \|.* \| ([^|]*) \|$", table, re.M):
                yield page.name, name, value, test

    @classmethod
    def values_in_the_code(cls):
        """Values of each name, which may be given in several places."""
        values = {}
        text = "".join(path.read_text(encoding="utf-8") for folder in ("src", "include", "scripts")
                       for path in sorted((SOURCE / folder).rglob("*"))
                       if path.is_file()
                       and (path.suffix in {".h", ".cpp"} or path.parent.name == "scripts"))
        text = re.sub(r"//.*", "", text)
        for name, value in re.findall(r"\b(\w+)\s*=\s*([-\w./' ]+)[,;)\s]", text):
            values.setdefault(name, set()).add(cls.number(value))
        group = ""
        yaml = (SOURCE / "config" / "tracker.yaml").read_text(encoding="utf-8")
        for indent, name, value in re.findall(r"^( *)(\w+):(.*)$", yaml, re.M):
            if not value:
                group = name + "/"
            full = (group if indent else "") + name
            literals = values.get(name, set()) - {None}
            values[full] = {cls.number(value)} & (literals or {cls.number(value)})
        return values

    def test_pages_are_short(self):
        self.assertGreater(len(self.PAGES), 8)
        for page in self.PAGES:
            text = page.read_text(encoding="utf-8").splitlines()
            self.assertLessEqual(len(text), 250, page.name)
            for number, line in enumerate(text, 1):
                self.assertTrue(len(line) <= 100 or line.startswith("|"),
                                "{}:{}".format(page.name, number))

    def test_constants_have_the_values_of_the_code(self):
        code, rows = self.values_in_the_code(), list(self.rows())
        wrong = ["{}: {} is not {}".format(page, name, value) for page, name, value, _ in rows
                 if self.number(value) not in code.get(name, {None}) - {None}]
        self.assertFalse(wrong, "\n" + "\n".join(wrong))
        self.assertGreater(len(rows), 100)

    def test_tests_of_constants_exist(self):
        files = {path.name for path in (SOURCE / "test").rglob("*")}
        wrong = []
        for page, name, _, test in self.rows():
            self.assertRegex(test, r"^(`[\w.]+`|the same|–)$", "{}: {}".format(page, name))
            if test.startswith("`") and test.strip("`") not in names_of_tests() | files:
                wrong.append("{}: no {}".format(page, test))
        self.assertFalse(wrong, "\n" + "\n".join(wrong))


class Programs(unittest.TestCase):
    def test_no_program_opens_a_window(self):
        for path in sorted((SOURCE / "src").rglob("*.cpp")):
            found = re.search(r"\b(imshow|namedWindow|waitKey)\b|highgui",
                              path.read_text(encoding="utf-8"))
            self.assertIsNone(found, "{}: {}".format(path, found))


if __name__ == "__main__":
    unittest.main(argv=sys.argv, verbosity=2)
