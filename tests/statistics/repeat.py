"""Repeats the tests of this folder with other seeds and tells how often they reject.

    tests/statistics/repeat.py PROGRAM FOLDER [--seeds N] [--error SHARE] [--filter TESTS]

PROGRAM is build/release/tests/statistics_test. Its results are kept in FOLDER, one file a seed, so that a
run that was interrupted goes on. Of tests without an error the table says how often they rejected (false
alarms), and which share of their p-values is below 5 %; of tests with an error put in, how often they
saw it (power).
"""
import argparse
import collections
import json
import os
import pathlib
import subprocess


def run(program, result, seed, error, tests):
    part = result.with_suffix(".part")
    knobs = {"AFTERGLOW_STATISTICS_SEED": str(seed), "AFTERGLOW_STATISTICS_ERROR": str(error)}
    # The exit status tells only whether some test failed, as some will.
    subprocess.run([program, f"--gtest_filter={tests}", f"--gtest_output=json:{part}"],
                   env=os.environ | knobs, stdout=subprocess.DEVNULL, check=False)
    part.rename(result)


def tests_in(result):
    for suite in json.loads(result.read_text())["testsuites"]:
        yield from ((suite["name"].split("/")[-1], test) for test in suite["testsuite"])


def table(results):
    """By suite and test: [runs, rejections, p-values, those below 5 %]."""
    rows = collections.defaultdict(lambda: [0, 0, 0, 0])
    for result in results:
        for suite, test in tests_in(result):
            row = rows[suite, test["name"].split("/")[0]]
            with_error = "Rejected" in test["name"]
            row[0] += 1
            row[1] += ("failures" in test) != with_error
            if not with_error:
                for name in ("p_value", "p_value_of_spread"):
                    row[2] += name in test
                    row[3] += float(test.get(name, 1.0)) < 0.05
    return rows


def main():
    parser = argparse.ArgumentParser(description="How often the tests of hypotheses reject.")
    parser.add_argument("program")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--error", type=float, default=0.02)
    parser.add_argument("--filter", default="*/*")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    results = [options.folder / f"seed_{seed}.json" for seed in range(1, options.seeds + 1)]
    for seed, result in enumerate(results, 1):
        if not result.exists():
            run(options.program, result, seed, options.error, options.filter)
    for (suite, test), (runs, rejected, values, small) in sorted(table(results).items()):
        line = f"{suite}.{test}: {rejected} of {runs} rejected"
        print(line + (f"; {small} of {values} p-values below 5 %" if values else ""))


if __name__ == "__main__":
    main()
