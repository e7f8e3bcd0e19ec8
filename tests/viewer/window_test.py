"""A person at the window: real key and mouse events under Xvfb, and pictures compared with frames
drawn without a window. Usage: window_test.py AFTERGLOW AFTERGLOW_VIEW."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

afterglow, view = sys.argv[1:3]
WIDTH, HEIGHT = 480, 360


def wait_for(condition, what, seconds=60):
    end = time.time() + seconds
    while time.time() < end:
        result = condition()
        if result:
            return result
        time.sleep(0.05)
    sys.exit(f"no {what} within {seconds} s")


class Screen:
    """A display of its own; its number is one that Xvfb finds free. Without -noreset the server starts
    over when xdotool, its only client so far, leaves, and turns away who comes meanwhile."""

    def __enter__(self):
        read_end, write_end = os.pipe()
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write_end), "-screen", "0", "1024x768x24", "-noreset"],
            pass_fds=[write_end], stderr=subprocess.DEVNULL)
        os.close(write_end)
        with os.fdopen(read_end) as answer:
            self.environment = dict(os.environ, DISPLAY=":" + answer.readline().strip())
        return self

    def __exit__(self, *_):
        self.server.terminate()
        self.server.wait()


class Window:
    def __init__(self, screen, file, folder):
        self.environment, self.folder = screen.environment, folder
        self.output = open(folder / "stdout", "w+")
        self.errors = open(folder / "stderr", "w+")
        self.program = subprocess.Popen(
            [view, file, "-o", folder, "--size", f"{WIDTH}x{HEIGHT}", "--indirect", "gather"],
            env=self.environment, stdout=self.output, stderr=self.errors)
        self.name = wait_for(self.find, "window")
        self.do("mousemove", "--window", self.name, 5, HEIGHT - 5)

    def find(self):
        if self.program.poll() is not None:
            sys.exit(f"the window did not open: {(self.folder / 'stderr').read_text()}")
        found = subprocess.run(["xdotool", "search", "--onlyvisible", "--name", "Afterglow"], env=self.environment,
                               capture_output=True, text=True)
        return found.stdout.split("\n")[0]

    def do(self, *words):
        subprocess.run(["xdotool", *map(str, words)], env=self.environment, check=True,
                       stdout=subprocess.DEVNULL)

    def key(self, name):
        self.do("windowfocus", self.name)
        self.do("key", name)

    def at(self, x, y):
        self.do("mousemove", "--window", self.name, x, y)
        time.sleep(0.1)

    def drag(self, button, start, end):
        self.at(*start)
        self.do("mousedown", button)
        for k in range(1, 6):
            self.at(*(a + (b - a) * k // 5 for a, b in zip(start, end)))
        self.do("mouseup", button)

    def drop(self, file):
        subprocess.run([sys.executable, pathlib.Path(__file__).parent / "drop_file.py", self.name, file],
                       env=self.environment, check=True)

    def files(self, pattern):
        return sorted(self.folder.glob(pattern))

    def makes(self, key, pattern):
        """The file that a key makes."""
        before = self.files(pattern)
        self.key(key)

        def new():
            if self.program.poll() is not None:
                sys.exit(f"the window ended with {self.program.returncode}: "
                         + (self.folder / "stderr").read_text())
            return [f for f in self.files(pattern) if f not in before]
        return wait_for(new, pattern)[0]

    def command_line(self):
        def lines():
            return (self.folder / "stdout").read_text().splitlines()
        before = len(lines())
        self.key("c")
        return wait_for(lambda: lines()[before:], "command line")[0].split()

    def settle(self):
        """Patches come until the picture no longer changes."""
        last = None
        for _ in range(40):
            time.sleep(0.5)
            picture = self.makes("p", "picture_*.exr")  # written last
            content = picture.read_bytes()
            for file in self.files("picture_*"):
                file.unlink()
            if content == last:
                return
            last = content
        sys.exit("the picture does not come to rest")


def options(words):
    return dict(zip(words[::2], words[1::2]))


def numbers(text):
    return [float(x) for x in text.split(",")]


def expect_like_headless(window, file, layer, folder):
    """The window's picture against the same frame of a run without a window."""
    window.settle()
    picture = window.makes("p", "picture_*.exr")
    words = options(window.command_line())
    frame = {"camera": {"position": numbers(words["--camera-position"]),
                        "target": numbers(words["--camera-target"]),
                        "up": numbers(words["--camera-up"]), "fov": float(words["--camera-fov"])},
             "light": {"position": numbers(words["--light-position"]),
                       "direction": numbers(words["--light-direction"]),
                       "cone": numbers(words["--light-cone"]),
                       "intensity": numbers(words["--light-intensity"])}}
    (folder / "frame.json").write_text(json.dumps([frame]))
    subprocess.run([view, file, "--headless", "--frames", folder / "frame.json", "-o", folder / "frames",
                    "--samples", "1", "--format", "exr", "--indirect", "gather", "--layer", layer,
                    "--size", words["--size"]], check=True)
    compared = subprocess.run([afterglow, "compare", picture, folder / "frames" / "frame_0000.exr",
                               "--json"], check=True, capture_output=True, text=True)
    error = json.loads(compared.stdout)["rel_rmse"]
    print(f"{layer}: {100 * error:.3f} % from the frame without a window")
    # Which pixel shows a patch first differs where the window's camera came from elsewhere; with so
    # few functions that is seen in single pixels beside edges.
    if not error < 0.02:
        sys.exit(f"the window's {layer} picture is another one")


def run(folder):
    file, other = folder / "cornell.afterglow", folder / "furnace.afterglow"
    for scene, output in (("cornell", file), ("furnace:0.5", other)):
        subprocess.run([afterglow, "precompute", f"builtin:{scene}", "-o", output, "--rays", "128",
                        "--receiver-levels", "4", "--sender-levels", "3", "--quiet"], check=True)
    with Screen() as screen:
        window = Window(screen, file, folder)
        first = window.makes("F12", "window_*.png").read_bytes()
        expect_like_headless(window, file, "full", folder)

        poses = [options(window.command_line())]

        def expect_moved(names, what):
            poses.append(options(window.command_line()))
            if all(poses[-1][name] == poses[-2][name] for name in names):
                sys.exit(f"{what} does nothing")

        middle, aside = (WIDTH // 2, HEIGHT // 2), (WIDTH // 2 + 30, HEIGHT // 2 + 15)
        window.key("Tab")  # no panels in the way

        # The light: along the view, cone, aimed, intensity, to the camera.
        window.do("keydown", "shift")
        window.drag(1, middle, aside)
        window.do("click", 5)
        window.do("keyup", "shift")
        expect_moved(["--light-position"], "moving the light")
        if poses[-1]["--light-cone"] == poses[-2]["--light-cone"]:
            sys.exit("the wheel does not narrow the cone")
        window.do("keydown", "ctrl")
        window.drag(1, middle, aside)
        window.do("click", 5)
        window.do("keyup", "ctrl")
        expect_moved(["--light-direction"], "aiming the light")
        if poses[-1]["--light-intensity"] == poses[-2]["--light-intensity"]:
            sys.exit("the wheel does not dim the light")
        window.key("l")
        expect_moved(["--light-position"], "L")

        # The camera: orbit, look, pan, zoom, fly.
        camera = ["--camera-position", "--camera-target"]
        for button, what in ((1, "orbit"), (3, "look"), (2, "pan")):
            window.drag(button, middle, aside)
            expect_moved(camera, what)
        window.at(*middle)
        window.do("click", 4)
        expect_moved(camera, "zoom")
        # The picture follows the pointer, and intensity alone.
        window.do("keydown", "ctrl")
        window.do("click", 4)
        window.do("keyup", "ctrl")
        expect_moved(["--light-intensity"], "the wheel with control")
        expect_like_headless(window, file, "full", folder)
        window.do("keydown", "s")
        time.sleep(0.5)
        window.do("keyup", "s")
        expect_moved(camera, "fly")

        # Every layer, then every view over the picture.
        layers = ["full", "direct", "indirect", "irradiance", "reflectance", "normals"]
        for k, layer in list(enumerate(layers))[1:]:
            window.key(str(k + 1))
            expect_like_headless(window, file, layer, folder)
        window.key("1")
        shots = [window.makes("F12", "window_*.png").read_bytes()]
        for overlay in ("points", "coefficients", "links"):
            window.key("o")
            window.at(*middle)
            window.do("click", 1)
            time.sleep(0.5)
            shots.append(window.makes("F12", "window_*.png").read_bytes())
        if len(set(shots)) < len(shots) or first in shots:
            sys.exit("two views look the same")
        window.key("o")

        # Record, play, resize, hide, a window of a few pixels.
        window.key("r")
        window.drag(1, middle, aside)
        recorded = window.makes("r", "path_*.json")
        if len(json.loads(recorded.read_text())) < 2:
            sys.exit("nothing was recorded")
        window.key("space")
        for size in ((300, 200), (9, 7), (WIDTH, HEIGHT)):
            window.do("windowsize", window.name, *size)
            time.sleep(0.7)
        window.do("windowunmap", window.name)
        time.sleep(0.5)
        window.do("windowmap", window.name)
        time.sleep(2)
        expect_like_headless(window, file, "full", folder)

        # Files dropped on it: a damaged one changes nothing, another scene is opened.
        damaged = folder / "damaged.afterglow"
        damaged.write_bytes(file.read_bytes()[:10000])
        window.drop(damaged)
        expect_like_headless(window, file, "full", folder)
        window.drop(other)
        expect_like_headless(window, other, "full", folder)

        window.key("Escape")
        status = window.program.wait(timeout=60)
        errors = (folder / "stderr").read_text()
        if status != 0 or errors:
            sys.exit(f"the window ended with {status}: {errors}")


with tempfile.TemporaryDirectory() as name:
    run(pathlib.Path(name))
