"""Every option that --help shows stands in the manual page and is offered by the completion, and what
an option is said to take is offered after it. Usage: manual_test.py MANUAL_FOLDER COMPLETION_FOLDER
PROGRAM..."""
import pathlib
import re
import subprocess
import sys
import tempfile

manual, completion = (pathlib.Path(folder).resolve() for folder in sys.argv[1:3])
failures = []


def expect(condition, message):
    if not condition:
        failures.append(message)


def output(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


class Help:
    """What --help says: subcommands, and each option with what it takes ("" for a flag)."""

    def __init__(self, program, *command):
        text = output(program, *command, "--help")
        self.options, self.takes = [], {}
        for line in text.splitlines():
            option = re.match(r"  (-[-\w,]+)( [^ ]+)?(?=  |$| )", line)
            if option:
                names = option[1].split(",")
                self.options += names
                for name in names:
                    self.takes[name] = (option[2] or "").strip()
        self.commands = re.findall(r"^  (\w+) ", text.partition("Subcommands:")[2], re.M)


def completed(program, folder, *words):
    """What bash offers for the last of the words. Bash itself takes = and : for words of their own."""
    typed = [part for word in (program, *words) for part in re.findall(r"[=:]|[^=:]+", word) or [""]]
    script = (f"source '{completion / program}'; COMP_WORDS=(\"$@\"); COMP_CWORD=$(($# - 1)); "
              f"$(complete -p {program} | sed 's/.*-F \\([^ ]*\\).*/\\1/'); printf '%s\\n' \"${{COMPREPLY[@]}}\"")
    run = subprocess.run(["bash", "-c", script, "bash", *typed], cwd=folder, capture_output=True, text=True)
    expect(run.returncode == 0 and not run.stderr, f"completing {words}: {run.stderr}")
    return set(run.stdout.split("\n")) - {""}


def check_page(name, page, commands):
    """commands: subcommand ("" for the program) -> its Help."""
    shown = re.sub(r"\\f.", "", page).replace("\\-", "-")
    sections = dict(re.findall(r"^\.SH (.*)\n((?:(?!\.SH ).*\n)*)", shown, re.M))
    for command, told in commands.items():
        section = sections.get(f"{name} {command}" if command else "OPTIONS", "")
        for option in told.options:
            expect(re.search(rf"(^|, ){option}( |,|$)", section, re.M), f"{name}.1: {command} {option} is missing")
    for section in ("NAME", "SYNOPSIS", "DESCRIPTION", "EXIT STATUS", "SEE ALSO"):
        expect(sections.get(section), f"{name}.1: {section} is missing")
    warnings = subprocess.run(["groff", "-man", "-Tutf8", "-ww", "-z"], input=page, capture_output=True, text=True)
    expect(warnings.returncode == 0 and not warnings.stderr, f"{name}.1: {warnings.stderr}")


def check_completion(name, commands, folder):
    for command, told in commands.items():
        before = [command] if command else []
        expect(completed(name, folder, *before, "--") == {o for o in told.options if o.startswith("--")},
               f"{name} {command}: options are not those of --help")
        for option in told.options:
            takes = told.takes[option]
            expect(takes != "TEXT", f"{name} {command} {option}: says TEXT, not what it takes")
            offered = completed(name, folder, *before, option, "") if takes else None
            if takes in ("FILE", "SCENE"):
                expect({"a b.obj", "folder"} <= offered, f"{name} {command} {option}: files are not offered")
            elif takes == "FOLDER":
                expect(offered == {"folder"}, f"{name} {command} {option}: offers {offered}")
            elif "|" in takes or "{" in takes:
                words = set(re.sub(r".*\{|\}", "", takes).replace("|", ",").split(","))
                expect(offered == words, f"{name} {command} {option}: offers {offered}, takes {words}")
                if option.startswith("--"):
                    word = min(words)
                    expect(word in completed(name, folder, *before, f"{option}={word[:2]}"), f"{option}= is not completed")
            elif takes:
                expect(offered == set(), f"{name} {command} {option}: offers {offered} for {takes}")


with tempfile.TemporaryDirectory() as folder:
    (pathlib.Path(folder) / "a b.obj").touch()
    (pathlib.Path(folder) / "folder").mkdir()
    options = 0
    for program in sys.argv[3:]:
        name = pathlib.Path(program).name
        commands = {"": Help(program)}
        subcommands = commands[""].commands
        commands |= {command: Help(program, command) for command in subcommands}
        options += sum(len(told.options) for told in commands.values())
        check_page(name, (manual / f"{name}.1").read_text(), commands)
        check_completion(name, commands, folder)
        if subcommands:
            expect(completed(name, folder, "") == set(subcommands), f"{name}: subcommands are not offered")
    expect("builtin:" in completed("afterglow", folder, "precompute", "bui"), "builtin: is not offered")
    expect("cornell" in completed("afterglow", folder, "precompute", "builtin:"), "built-in scenes are not offered")
    expect(completed("afterglow", folder, "precompute", "builtin:co") == {"cornell"}, "builtin:co is not completed")
    expect(completed("afterglow", folder, "precompute", "a") == {"a b.obj"}, "a scene's file is not completed")

print("\n".join(failures) if failures else f"{options} options, each in its page and completed")
sys.exit(1 if failures or options < 50 else 0)
