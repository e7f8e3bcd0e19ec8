"""Precomputes under limits of address space: it either succeeds with the bytes of an unlimited run, or says
one line and ends with status 1.

    memory_test.py AFTERGLOW [--limits 20] [--options '...']

The limits lie evenly between that at which the program can just print its version, so that its libraries
are loaded, and that at which the precomputation succeeds, both found by bisection.
"""
import argparse
import pathlib
import resource
import shlex
import subprocess
import sys
import tempfile

MEGABYTE = 1 << 20


def run(command, megabytes):
    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (megabytes * MEGABYTE, megabytes * MEGABYTE))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    return subprocess.run(command, preexec_fn=limit if megabytes else None, capture_output=True, text=True)


def least(command, low, high):
    while high - low > 4:
        middle = (low + high) // 2
        if run(command, middle).returncode == 0:
            high = middle
        else:
            low = middle
    return high


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("afterglow")
    parser.add_argument("--limits", type=int, default=20)
    parser.add_argument("--options", default="--receiver-levels 4 --sender-levels 3 --rays 64 --quiet")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="afterglow-faults-") as name:
        folder = pathlib.Path(name)
        file = folder / "t"
        command = [arguments.afterglow, "precompute", "builtin:cornell", "--threads", "2", "-o", str(file),
                   *shlex.split(arguments.options)]
        if run(command, 0).returncode != 0:
            sys.exit("memory_test: the unlimited run failed")
        right = file.read_bytes()
        file.unlink()
        loaded = least([arguments.afterglow, "--version"], 1, 1024)
        enough = least(command, loaded, 2048)
        file.unlink(missing_ok=True)
        plenty = enough + 64  # how much is enough differs from run to run
        if run(command, plenty).returncode != 0 or file.read_bytes() != right:
            sys.exit(f"memory_test: {plenty} MB are not enough")
        file.unlink()
        failed, lines = 0, set()
        for k in range(arguments.limits):
            megabytes = loaded + (enough - loaded) * k // arguments.limits
            outcome = run(command, megabytes)
            if outcome.returncode == 0:
                if file.read_bytes() != right:
                    sys.exit(f"memory_test: other bytes under {megabytes} MB")
                file.unlink()
                continue
            failed += 1
            line = outcome.stderr
            lines.add(line.strip())
            if outcome.returncode != 1 or not line.startswith("afterglow: ") or line.count("\n") != 1:
                sys.exit(f"memory_test: status {outcome.returncode} under {megabytes} MB: {line}")
            if any(folder.iterdir()):
                sys.exit(f"memory_test: something was left under {megabytes} MB")
        print(f"{arguments.limits} limits from {loaded} to {enough} MB: {failed} ended with one line and status 1, "
              f"{arguments.limits - failed} with the right bytes. The lines:")
        print("\n".join(sorted(lines)))
        if failed == 0:
            sys.exit("memory_test: no limit was met")


if __name__ == "__main__":
    main()
