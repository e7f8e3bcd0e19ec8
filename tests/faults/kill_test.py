"""Kills precomputations at random moments and looks at what is left.

    kill_test.py AFTERGLOW [--kills 50] [--scene builtin:cornell] [--signals INT,TERM,KILL] [--seed 1]
                 [--options '...']

First an undisturbed run, whose bytes and time all else is measured against. Then, for each signal,
as many precomputations as asked for, each killed at a random moment of that time: no file may stand under
the final name but a whole one with the right bytes, nothing unfinished beside it (but after SIGKILL, until
the next run), and SIGINT and SIGTERM must end it within a second, with one line and status 128 + signal.
Last, for each signal, precomputations with --checkpoint that are killed and started again until they are
done: their bytes must be those of the undisturbed run, and no checkpoint may be left.
"""
import argparse
import os
import pathlib
import random
import shlex
import signal
import subprocess
import sys
import tempfile
import time

LIMIT = 1.0  # seconds from a signal to the end


class Fault(Exception):
    pass


def expect(condition, what):
    if not condition:
        raise Fault(what)


def start(command):
    # A shell may have started this program with SIGINT ignored, and that is inherited.
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                            text=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))


def undisturbed(command):
    begin = time.monotonic()
    process = start(command)
    errors = process.communicate()[1]
    expect(process.returncode == 0, f"the undisturbed run failed: {errors}")
    return time.monotonic() - begin, errors


def processor_seconds(process):
    """Of all its threads until now."""
    fields = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def end(process, number):
    """Sends the signal and waits. Returns the seconds that took: on the clock, or, on a machine too busy to
    let the process run, of processor time if that is less."""
    used = processor_seconds(process)
    begin = time.monotonic()
    process.send_signal(number)
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.monotonic() - begin
    process.returncode = os.waitstatus_to_exitcode(status)
    return min(seconds, max(0.0, usage.ru_utime + usage.ru_stime - used))


def killed(command, number, moment):
    """Runs the command, kills it at the moment if it is not done by then. Returns whether it was killed, the
    seconds from the signal to the end, and what it said."""
    process = start(command)
    try:
        errors = process.communicate(timeout=moment)[1]
        expect(process.returncode == 0, f"status {process.returncode} of a run that was not killed: {errors}")
        return False, 0.0, errors
    except subprocess.TimeoutExpired:
        pass
    seconds = end(process, number)
    errors = process.communicate()[1]  # with what it said before
    if process.returncode == 0:
        return False, seconds, errors  # it was done just then
    if number == signal.SIGKILL:
        expect(process.returncode == -number, f"status {process.returncode} after SIGKILL")
        return True, seconds, errors
    if process.returncode == -number and not errors:
        return True, seconds, errors  # it had not come to main() yet
    expect(process.returncode == 128 + number, f"status {process.returncode} after {number.name}: {errors}")
    last = errors.splitlines()[-1] if errors else ""
    words = {signal.SIGINT: "afterglow: interrupted", signal.SIGTERM: "afterglow: ended by SIGTERM"}[number]
    expect(last.startswith(words), f"{number.name} was answered by '{last}'")
    output = pathlib.Path(command[command.index("-o") + 1])
    if "--checkpoint" in command and not output.exists():
        expect("goes on from" in last, f"no word of the checkpoint in '{last}'")
    expect(seconds < LIMIT, f"{seconds:.2f} s from {number.name} to the end")
    return True, seconds, errors


def look_at(folder, right, may_be_unfinished):
    """What a killed run left in the folder. Returns (whole files, unfinished files)."""
    whole = unfinished = 0
    for path in folder.iterdir():
        if path.name == "t":
            expect(path.read_bytes() == right, "a file with other bytes stands under the final name")
            whole += 1
        elif ".part-" in path.name and may_be_unfinished:
            unfinished += 1
        else:
            expect(path.name == "checkpoint", f"{path.name} was left")
    return whole, unfinished


def kill_alone(number, moments, command, folder, right):
    count = longest = whole = unfinished = 0
    for moment in moments:
        was_killed, seconds, _ = killed(command, number, moment)
        count += was_killed
        longest = max(longest, seconds)
        found = look_at(folder, right, number == signal.SIGKILL)
        whole += found[0]
        unfinished += found[1]
        (folder / "t").unlink(missing_ok=True)
    expect(count > 0, f"no run was still there when {number.name} came")
    undisturbed(command)  # also tidies up
    expect([path.name for path in folder.iterdir()] == ["t"], "something is left beside the file of the next run")
    expect((folder / "t").read_bytes() == right, "the next run made other bytes")
    (folder / "t").unlink()
    print(f"{number.name}: {count} of {len(moments)} killed, {longest:.3f} s to the end at most; {whole} whole files "
          f"with the right bytes, 0 others, {unfinished} .part files that the next run removed", flush=True)


def kill_and_go_on(number, kills, rng, span, command, folder, right):
    count = runs = finished = resumed = 0
    longest = 0.0
    while count < kills or (resumed == 0 and count < 10 * kills):
        runs += 1
        was_killed, seconds, errors = killed(command, number, rng.uniform(0.2, 0.7) * span)
        count += was_killed
        resumed += "are there already" in errors
        longest = max(longest, seconds)
        whole, _ = look_at(folder, right, number == signal.SIGKILL)
        if not was_killed:
            expect(whole == 1, "a run that ended by itself made no file")
            finished += 1
        (folder / "t").unlink(missing_ok=True)
    resumed += "are there already" in undisturbed(command)[1]
    expect(resumed > 0, "no run went on from a checkpoint")
    expect((folder / "t").read_bytes() == right, "what went on from a checkpoint has other bytes")
    expect([path.name for path in folder.iterdir()] == ["t"], "a checkpoint is left")
    (folder / "t").unlink()
    print(f"{number.name} with --checkpoint: {count} of {runs + 1} runs killed, {longest:.3f} s to the end at most; "
          f"{resumed} went on from a checkpoint, {finished + 1} to the end, all with the right bytes", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("afterglow")
    parser.add_argument("--kills", type=int, default=50, help="of each signal, without and with --checkpoint")
    parser.add_argument("--scene", default="builtin:cornell")
    parser.add_argument("--options", default="--receiver-levels 5 --sender-levels 4 --rays 64 --no-verification")
    parser.add_argument("--signals", default="INT,TERM,KILL")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    with tempfile.TemporaryDirectory(prefix="afterglow-faults-") as name:
        folder = pathlib.Path(name)
        command = [arguments.afterglow, "precompute", arguments.scene, "-o", str(folder / "t"),
                   *shlex.split(arguments.options)]
        span = min(undisturbed(command)[0] for _ in range(2))
        right = (folder / "t").read_bytes()
        (folder / "t").unlink()
        print(f"undisturbed: {span:.2f} s, {len(right)} bytes", flush=True)
        for word in arguments.signals.split(","):
            number = signal.Signals[f"SIG{word}"]
            kill_alone(number, [rng.uniform(0.02, 1.05) * span for _ in range(arguments.kills)], command, folder, right)
            kill_and_go_on(number, arguments.kills, rng, span,
                           [*command, "--checkpoint", str(folder / "checkpoint"), "--checkpoint-every", "0"],
                           folder, right)


if __name__ == "__main__":
    try:
        main()
    except Fault as fault:
        sys.exit(f"kill_test: {fault}")
