#!/usr/bin/python3
"""The quick run of all experiments of the thesis still finds what doc/reproduction.md says of it.

AMS_PROGRAMS: folder of the built programs. The page is older than the code where a verdict differs:
    scripts/update_reproduction --quick OUT
"""

import csv
import os
import pathlib
import subprocess
import tempfile
import unittest

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
EXPECTED = REPOSITORY / "doc" / "reproduction_quick.csv"


def findings(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


class Reproduction(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        program = pathlib.Path(os.environ["AMS_PROGRAMS"]) / "reproduce"
        subprocess.run([program, "all", "--quick", "--output", cls.folder.name], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        cls.found = {}
        for path in sorted(pathlib.Path(cls.folder.name).glob("*.findings.csv")):
            for row in findings(path):
                cls.found[path.name.split(".")[0], row["quantity"]] = row

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_every_finding_of_the_page_is_found_again(self):
        expected = {(row["experiment"], row["quantity"]): row["verdict"]
                    for row in findings(EXPECTED)}
        self.assertGreater(len(expected), 10)
        self.assertEqual(set(expected), set(self.found), "findings of the page, and of the run")
        for key, verdict in expected.items():
            with self.subTest(experiment=key[0], quantity=key[1]):
                if self.found[key]["is_duration"] == "1":
                    continue  # depends on the machine
                self.assertEqual(verdict, self.found[key]["verdict"], self.found[key]["here"])

    def test_most_findings_agree_with_the_thesis(self):
        verdicts = [row["verdict"] for row in self.found.values() if row["is_duration"] != "1"]
        self.assertGreater(verdicts.count("agrees"), 2 * verdicts.count("differs"))


if __name__ == "__main__":
    unittest.main()
