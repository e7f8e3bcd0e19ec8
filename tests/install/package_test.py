"""Installs into a folder, builds docs/example with what is there and nothing of the source tree, and
compares what it prints with what the installed program says. Usage: package_test.py CMAKE BUILD_FOLDER CXX."""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

cmake, build, compiler = sys.argv[1:4]
source = pathlib.Path(__file__).resolve().parents[2]


def output(*command, **rest):
    run = subprocess.run([str(word) for word in command], capture_output=True, text=True, **rest)
    if run.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{run.stdout}{run.stderr}")
    return run.stdout


def numbers(text):
    return [float(number) for number in text.split(",")]


def expect_close(what, values, others, tolerance):
    if len(values) != 3 or any(abs(a - b) > tolerance * abs(b) for a, b in zip(values, others)):
        sys.exit(f"{what}: {values}, not {others}")


def public_headers_stand_alone(prefix, folder):
    """Each header, twice and alone, with the flags that a consumer has."""
    root = prefix / "include/afterglow"
    headers = sorted(header.relative_to(root).as_posix() for header in root.rglob("*.h"))
    if "core/embree.h" in headers or "transport/precompute.h" not in headers or len(headers) < 40:
        sys.exit(f"headers are not those that are public: {headers}")
    unit = folder / "headers.cpp"
    unit.write_text("".join(f'#include "{header}"\n' for header in headers + headers) + "int main() {}\n")
    output(compiler, "-std=c++20", "-Wall", "-Wextra", "-fsyntax-only", f"-I{root}",
           *output("pkg-config", "--cflags", "eigen3").split(), unit)
    return len(headers)


def example(prefix, folder, flags):
    """What the example prints, as name -> three numbers."""
    output(cmake, "-G", "Ninja", "-S", prefix / "share/doc/afterglow/docs/example", "-B", folder,
           f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_CXX_COMPILER={compiler}", f"-DCMAKE_CXX_FLAGS={flags}")
    output(cmake, "--build", folder)
    printed = output(folder / "irradiance", "builtin:cornell", 0.278, 0.54, 0.28)
    return {line.split()[0]: numbers(line.split()[1]) for line in printed.splitlines()}


with tempfile.TemporaryDirectory() as temporary:
    folder = pathlib.Path(temporary)
    first = folder / "first"
    output(cmake, "--install", build, "--prefix", first)
    # Moved, so that no path of the first place can be in it.
    prefix = folder / "moved"
    shutil.move(first, prefix)
    for file in ("bin/afterglow", "bin/afterglow-view", "share/man/man1/afterglow.1.gz", "share/man/man1/afterglow-view.1.gz",
                 "share/bash-completion/completions/afterglow", "share/doc/afterglow/copyright"):
        if not (prefix / file).is_file():
            sys.exit(f"{file} is not installed")
    for config in prefix.rglob("*.cmake"):
        if str(source) in config.read_text() or str(first) in config.read_text():
            sys.exit(f"{config.name} names a folder that it was built or first installed in")
    headers = public_headers_stand_alone(prefix, folder)

    printed = example(prefix, folder / "example", "")
    position, normal = printed["position"], printed["normal"]
    (folder / "points.csv").write_text("x,y,z,nx,ny,nz\n" + ",".join(f"{v:.9g}" for v in position + normal) + "\n")
    environment = dict(os.environ, AFTERGLOW_PORTABLE="1")
    output(prefix / "bin/afterglow", "precompute", "builtin:cornell", "-o", folder / "t", "--no-verification", "--quiet",
           env=environment)
    output(prefix / "bin/afterglow", "query", folder / "t", "--points", folder / "points.csv", "-o", folder / "e.csv",
           "--light-position", "0.278,0.54,0.28", "--light-direction", "0,-1,0", "--quiet", env=environment)
    told = numbers((folder / "e.csv").read_text().splitlines()[1])
    # The same code in the same order; the program reads links from a file and prints fewer digits.
    expect_close("the example and the installed program", printed["indirect"], told, 1e-5)

    # A consumer's own instruction set changes Eigen's alignment, which must not matter.
    wide = example(prefix, folder / "wide", "-march=native")
    expect_close("the example for this processor's vectors", wide["indirect"], printed["indirect"], 1e-4)

print(f"{headers} headers; indirect irradiance {printed['indirect']}, as the program says")
