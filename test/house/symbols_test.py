#!/usr/bin/env python3
"""The library's own Eigen functions, which call BLAS, are not offered to other libraries."""
import re
import subprocess
import sys
import unittest

LIBRARY = sys.argv.pop(1)


class Symbols(unittest.TestCase):
    def test_no_function_of_eigen_is_exported(self):
        lines = subprocess.run(["nm", "--dynamic", "--defined-only", LIBRARY], check=True,
                               stdout=subprocess.PIPE, universal_newlines=True).stdout.splitlines()
        self.assertTrue(any("20active_matching_slam" in line for line in lines))
        self.assertEqual([line for line in lines if re.search(r" _ZNK?5Eigen", line)], [])


if __name__ == "__main__":
    unittest.main()
