"""The program runs on a processor of 2003, and as its faster twin on one that has AVX2.
Usage: processor_test.py AFTERGLOW FAST_AFTERGLOW."""
import math
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile

portable, fast = sys.argv[1:3]
EMULATOR = "qemu-x86_64"
PLAIN = dict(os.environ, AFTERGLOW_PORTABLE="1")


def run(*command, environment=None):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, env=environment)


def expect(condition, message):
    if not condition:
        sys.exit(message)


def disassembled(program):
    return run("objdump", "-d", "--no-show-raw-insn", program).stdout


# No instruction of AVX or later anywhere, whether it is reached or not: all begin with v, but two of 2003's.
newer = re.compile(r"\tv(?!err|erw|mcall|mlaunch)[a-z]", re.M)
expect(newer.search(disassembled(fast)), f"{fast} has no AVX instruction: it is not what it should be")
found = newer.search(disassembled(portable))
expect(not found, f"{portable} has instructions of newer processors")

with tempfile.TemporaryDirectory() as temporary:
    folder = pathlib.Path(temporary)
    # Which of the two goes on is seen by putting something else in the place of the faster.
    (folder / "bin").mkdir()
    shutil.copy(portable, folder / "bin/afterglow")
    alone = run(folder / "bin/afterglow", "--version")
    expect(re.match(r"\d+\.\d+\.\d+\n$", alone.stdout), f"without its twin the program fails: {alone.stderr}")
    twins = folder / "lib/afterglow/x86-64-v3"
    twins.mkdir(parents=True)
    (twins / "afterglow").write_text("#!/bin/sh\necho \"twin $@\"\n")
    (twins / "afterglow").chmod(0o755)
    flags = pathlib.Path("/proc/cpuinfo").read_text().split("flags", 1)[1].split("\n")[0].split()
    if {"avx2", "fma", "bmi1", "bmi2", "f16c", "movbe", "abm"} <= set(flags):
        here = run(folder / "bin/afterglow", "query", "a b")
        expect(here.stdout == "twin query a b\n", f"the twin is not started here: {here.stdout}{here.stderr}")
    kept = run(folder / "bin/afterglow", "--version", environment=PLAIN)
    expect(kept.stdout == alone.stdout, "AFTERGLOW_PORTABLE=1 is not heeded")

    for processor in ("qemu64", "Nehalem"):
        old = run(EMULATOR, "-cpu", processor, folder / "bin/afterglow", "--version")
        expect(old.stdout == alone.stdout, f"{processor}: {old.returncode} {old.stdout}{old.stderr}")
        died = run(EMULATOR, "-cpu", processor, fast, "--version")
        expect(died.returncode in (-signal.SIGILL, 128 + signal.SIGILL),
               f"{processor} runs the faster program too: this test would see nothing")

    # Not --version alone: Embree chooses its kernels by the processor too, and all loops are run.
    made = run(EMULATOR, "-cpu", "qemu64", folder / "bin/afterglow", "precompute", "builtin:cornell", "-o", folder / "t",
               "--coarse-radius", 0.6, "--rays", 16, "--no-verification", "--quiet")
    expect(made.returncode == 0, f"precompute on qemu64: {made.returncode} {made.stderr}")
    told = run(portable, "info", folder / "t")
    expect(told.returncode == 0 and "builtin:cornell" in told.stdout, f"its file: {told.stdout}{told.stderr}")

    # What one variant has made, the other takes for a file of the same scene: a scene must not depend on how its
    # numbers are rounded. Normals out of a file are scaled to unit length, of which most round in some way.
    lines = ["mtllib none.mtl"]
    for k in range(300):
        x, y, z = math.sin(k), math.cos(7 * k), math.sin(3 * k + 1)
        lines += [f"v {k % 20} 0 {k // 20}", f"v {k % 20 + 1} 0 {k // 20}", f"v {k % 20} 0 {k // 20 + 1}",
                  f"vn {x:.4f} {y + 2:.4f} {z:.4f}", f"f {3 * k + 1}//{k + 1} {3 * k + 3}//{k + 1} {3 * k + 2}//{k + 1}"]
    lines += ["v -5 9 -5", "v 25 9 -5", "v 25 9 20", "v -5 9 20", "f -4 -3 -2 -1"]
    (folder / "s.obj").write_text("\n".join(lines) + "\n")
    for scene, viewpoint, lamp, point in ((folder / "s.obj", "10,4,7", "10,8,7", "4.2,0,4.2,0,1,0"),
                                          ("builtin:sphere:0.5", "0,0,0", "0,0.5,0", "0.57,-0.76,0,-0.6,0.8,0")):
        (folder / "points.csv").write_text(point + "\n")
        light = ("--light-position", lamp, "--light-direction", "0.1,-1,0", "--light-cone", "30,40")
        for maker in (portable, fast):
            made = run(maker, "precompute", scene, "-o", folder / "s", "--viewpoint", viewpoint,
                       "--coarse-radius", 4, "--receiver-levels", 3, "--sender-levels", 2, "--rays", 16,
                       "--no-verification", "--quiet", environment=PLAIN)
            expect(made.returncode == 0, f"precompute: {made.stderr}")
            answers = []
            for reader in (portable, fast):
                read = run(reader, "query", folder / "s", "--points", folder / "points.csv", "-o", folder / "e.csv",
                           "--quiet", *light, environment=PLAIN)
                expect(read.returncode == 0, f"a file of {maker} is refused by {reader}: {scene}: {read.stderr}")
                lines = (folder / "e.csv").read_text().splitlines()
                answers.append([float(number) for line in lines[1:] for number in line.split(",")])
            expect(answers[0] and min(answers[0]) > 0, f"no light: {answers[0]}")
            for one, other in zip(*answers, strict=True):
                expect(abs(one - other) <= 1e-4 * one, f"{scene} by {maker}: portable {one}, with AVX2 {other}")

print("runs on qemu64 and Nehalem, and as its twin with AVX2")
