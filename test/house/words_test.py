#!/usr/bin/env python3
"""The words of the house: what has a standard term in state estimation is called by it.

Refused words are found in any spelling of identifiers (deferredPruning, deferred_pruning) and in
prose. Ordinary English is not refused, but for words that had a private meaning here.
"""
import re
import unittest
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGE = "active_matching_slam"
FOLDERS = ("src", "include/" + PACKAGE, "msg", "config", "doc", "test")
SUFFIXES = {".h", ".hpp", ".cpp", ".py", ".md", ".msg", ".yaml", ".test", ".in"}

# Rooms that are not held to it yet: src/ROOM, include/.../ROOM and test/ROOM, or a whole folder.
NOT_YET = {"filter", "tracker", "map"}

# A regular expression on the words of a line, in lower case and separated by single spaces, and
# the field's term.
REPLACEMENTS = {
    "readings": "candidate solutions, motion hypotheses",
    "opposites": "bas-relief counterparts",
    "reverse depths": "bas-relief counterpart",
    "settled|settlings?": "disambiguated; of corners: refined",
    "believed|believes": "current estimate, the filter's estimate",
    "credited": "assumed",
    "wander(s|ing|ed|ers?)?": "process noise (random walk)",
    "let corners wander": "landmark process noise",
    "lasting": "temporally correlated (coloured) noise",
    "repetitions": "variance inflation factor for correlated measurements",
    "like most|in that of most": "relative to the median",
    "noise left": "redundancy number",
    "left px": "post-fit residual",
    "for each miss|squared miss": "residual, reprojection error",
    "pulls?|feature pull": "score (gradient), information",
    "scatters?": "variance inflation, sandwich factor; covariance",
    "choose unit|unit shares?|share of unit": "scale gauge",
    "weigh images": "variance component estimation",
    "drop wanderers": "outlier landmark rejection",
    "thin out": "keyframe culling",
    "take over": "commit, apply",
    "calibration share": "partial-update weight",
    "doubt velocity": "velocity decay with covariance inflation",
    "(un)?heard|hearings?": "deferred pruning, unconfirmed",
    "runners? up": "k-best alternatives",
    "recount(s|ed|ing)?": "joint re-scoring",
    "lineages?": "ancestry",
    "sterile": "exhausted, uninformative",
    "ledgers?": "cost budget",
    "ask too|second opinions?": "fallback matcher",
    "astray": "relocalisation attempts",
    "chance check": "a-contrario (NFA) test",
    "agreeing measurements": "leave-one-out chi-square gate",
    "k share of( \\w+)*": "fraction, ratio, weight",
}
PATTERNS = [(re.compile(r"\b(" + word + r")\b"), term) for word, term in REPLACEMENTS.items()]


def words_of(line):
    """The words of a line, identifiers taken apart."""
    line = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", line)
    return " ".join(re.findall(r"[a-z0-9]+", line.lower()))


def room_of(path):
    parts = path.relative_to(REPOSITORY).parts
    if parts[0] == "include":
        return parts[2]
    return parts[1] if parts[0] in ("src", "test") else parts[0]


def refused_in(text):
    """(line number, word, the field's term) of each refused word."""
    for number, line in enumerate(text.splitlines(), start=1):
        words = words_of(line)
        for pattern, term in PATTERNS:
            for match in pattern.finditer(words):
                yield number, match.group(1), term


class Words(unittest.TestCase):
    def test_words_are_found_in_every_spelling(self):
        for text in ("kShareOfNoise", "double k_share_of_noise", "second opinion",
                     "secondOpinion", "SearchLedger", "corner_wander_px", "awaitsHearing"):
            self.assertTrue(list(refused_in(text)), text)
        for text in ("shared_ptr", "a share of the time", "reading a file", "rehearsal"):
            self.assertEqual(list(refused_in(text)), [], text)

    def test_every_room_uses_the_words_of_the_field(self):
        wrong = []
        for folder in FOLDERS:
            for path in sorted((REPOSITORY / folder).rglob("*")):
                if path.suffix not in SUFFIXES or path == Path(__file__).resolve():
                    continue
                if room_of(path) in NOT_YET:
                    continue
                name = path.relative_to(REPOSITORY)
                wrong += [f"{name}:{number}: '{word}', say: {term}"
                          for number, word, term in refused_in(path.read_text(encoding="utf-8"))]
                wrong += [f"{name}: '{word}' in its name, say: {term}"
                          for _, word, term in refused_in(path.stem)]
        self.assertEqual(wrong, [], "\n" + "\n".join(wrong))


if __name__ == "__main__":
    unittest.main()
