#!/usr/bin/env python3
"""Every named number says where it is from: a constant's comment has one of ORIGINS.

A constant made from others, such as a sum of sizes, is no number of its own, nor are those that
its declaration is made from. Comments stand above a constant, or a row of them, or behind it.
"""
import re
import unittest
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGE = "active_matching_slam"
ROOMS = ("filter", "initialisation")  # those that are held to it; others follow
ORIGINS = ("Derivation:", "Standard:", "Cost:", "Learnt:", "Option:")
BEGIN = re.compile(r"^\s*(static |inline )*constexpr (double|int|std::size_t) k[A-Z]")


def constants(text):
    """(line number, names, comment) of each declaration of numbers."""
    lines = text.splitlines()
    for number, line in enumerate(lines):
        if not BEGIN.match(line):
            continue
        end = number
        while ";" not in lines[end].split("//")[0]:
            end += 1
        declaration = " ".join(part.split("//")[0] for part in lines[number:end + 1])
        values = re.findall(r"\b(k[A-Z]\w*)\s*(?:=\s*([^,;]*)|\{([^}]*)\})", declaration)
        if any(re.search(r"\bk[A-Z]", "".join(value[1:])) for value in values):
            continue
        begin = number
        while begin > 0 and BEGIN.match(lines[begin - 1]):
            begin -= 1
        first = begin
        while first > 0 and lines[first - 1].lstrip().startswith("//"):
            first -= 1
        comment = lines[first:begin]
        comment += [part.partition("//")[2] for part in lines[number:end + 1]]
        yield number + 1, [value[0] for value in values], "\n".join(comment)


def files(room):
    for folder in (REPOSITORY / "src" / room, REPOSITORY / "include" / PACKAGE / room):
        yield from sorted(path for path in folder.rglob("*") if path.suffix in {".h", ".cpp"})


class Constants(unittest.TestCase):
    def test_an_origin_is_found_above_and_behind(self):
        text = ("/// Standard: a table.\nconstexpr double kA = 1.0, kB = 2.0;\n"
                "constexpr int kC = 3;  ///< Cost: time\n\nconstexpr int kD = 4;  // a number\n"
                "constexpr int kE = 2 * kD;\n")
        found = [(names, any(origin in comment for origin in ORIGINS))
                 for _, names, comment in constants(text)]
        self.assertEqual(found, [(["kA", "kB"], True), (["kC"], True), (["kD"], False)])

    def test_every_number_says_where_it_is_from(self):
        wrong, counts = [], {}
        for room in ROOMS:
            for path in files(room):
                for number, names, comment in constants(path.read_text(encoding="utf-8")):
                    counts[room] = counts.get(room, 0) + len(names)
                    if not any(origin in comment for origin in ORIGINS):
                        wrong.append("{}:{}: {}".format(path.relative_to(REPOSITORY), number,
                                                        ", ".join(names)))
        print("named numbers: " + ", ".join("{} {}".format(*item) for item in counts.items()))
        self.assertFalse(wrong, "\nwithout {}:\n{}".format(" ".join(ORIGINS), "\n".join(wrong)))


if __name__ == "__main__":
    unittest.main(verbosity=2)
