#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""clang-tidy over the product's sources: tests/tidy.py BUILD [JOBS] [--all]

Without --all, checks only sources in folders whose code differs from origin/main or, on main itself, from 20 commits
ago. A changed comment is not code, except NOLINT.
BUILD is configured with -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON -DR4_UNITY=ON. Files that are one source for the
compiler (cmake/layers.cmake) are one source for clang-tidy, which then reads the headers once instead of a dozen times.
The texts of these files are joined, not included, because the analyzer follows only code in the file that it is given.
"""
import collections
import concurrent.futures
import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
CHECKED = tuple(f"{ROOT / folder}/" for folder in ("protocol", "transports", "firmware", "host", "tools"))
# clang 14 has coroutines, but libstdc++ and Asio do not detect them. The analyzer gets a tenth of its usual limit of
# paths per function. This limit halves the time, and the analyzer still follows thousands of paths.
EXTRA = ["-D__cpp_impl_coroutine=201902L", "-DASIO_HAS_CO_AWAIT", "-DASIO_HAS_STD_COROUTINE",
         "-Xclang", "-analyzer-config", "-Xclang", "max-nodes=20000"]
UNKNOWN_TO_CLANG = " -fno-gnu-unique"


class Source:
    """An input of clang-tidy: one file, or several files joined."""

    def __init__(self, files):
        self.files = files
        self.lines = []  # for each line of a joined source: (file, line number)

    def write(self, path):
        with path.open("w") as out:
            for file in self.files:
                for number, line in enumerate(file.read_text().splitlines(), 1):
                    out.write(line + "\n")
                    self.lines.append((file, number))

    def told(self, path, text):
        """Returns `text` with the places of the joined source replaced by places in the tree."""
        def place(match):
            file, number = self.lines[int(match[1]) - 1]
            return f"{file}:{number}:"
        return re.sub(re.escape(str(path)) + r":(\d+):", place, text) if self.lines else text


def files_of(entry):
    """The files of the tree that an entry of the compilation database compiles."""
    path = pathlib.Path(entry["directory"], entry["file"])
    if path.parent.name != "Unity":
        return [path]
    return [pathlib.Path(name) for name in re.findall(r'^#include "(.*)"$', path.read_text(), re.MULTILINE)]


def sources_of(build):
    """Writes the inputs of clang-tidy and their compilation database to BUILD/tidy, and returns path -> Source."""
    folder = build / "tidy"
    folder.mkdir(exist_ok=True)
    sources, database, seen = {}, [], set()
    for entry in json.loads((build / "compile_commands.json").read_text()):
        files = [file for file in files_of(entry) if str(file).startswith(CHECKED) and file not in seen]
        if not files:
            continue
        seen.update(files)
        source = Source(files)
        path = files[0]
        beside = ""
        if len(files) > 1:
            path = folder / f"{files[0].parent.relative_to(ROOT)}-{files[0].stem}.cpp".replace("/", "-")
            source.write(path)
            beside = "".join(f"-iquote {place} " for place in sorted({file.parent for file in files}))
        command = entry["command"].replace(UNKNOWN_TO_CLANG, "")
        command = command.replace(" -c ", f" {beside}-c ").replace(entry["file"], str(path))
        sources[path] = source
        database.append({**entry, "file": str(path), "command": command})
    (folder / "compile_commands.json").write_text(json.dumps(database))
    return sources


def folders_of(difference):
    """The folders with a changed line of code, from the output of git diff."""
    folders, names = set(), []
    for line in difference.splitlines():
        if line.startswith("diff --git "):
            names = []
        elif line.startswith(("--- a/", "+++ b/")):
            names.append(line[6:].rstrip("\t"))
        elif re.match(r"[-+](?!\s*(//(?!.*NOLINT).*)?$)", line) and not line.startswith(("--- ", "+++ ")):
            folders.update((ROOT / name).parent for name in names)
    return folders


def changed_folders():
    """The folders of the tree with changed code, or None if the changes are unknown."""
    def git(*arguments):
        result = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True)
        return result.stdout.strip() if result.returncode == 0 else None
    head, base = git("rev-parse", "HEAD"), git("merge-base", "HEAD", "origin/main")
    if base in (None, head):
        base = git("rev-parse", "HEAD~20")
    difference = base and git("diff", "--no-color", "--no-renames", "--unified=0", base)
    return None if difference is None else folders_of(difference)


def included_twice(file):
    """Replaces clang-tidy's check for duplicate includes, which fails on joined files. A .def may occur repeatedly."""
    lines = collections.Counter(line for line in file.read_text().splitlines()
                                if line.startswith("#include") and not line.endswith('.def"'))
    return [f"{file}: {line} is there twice\n" for line, times in lines.items() if times > 1]


def check(command, build, path, source):
    """Returns the findings of clang-tidy; empty if there are none."""
    arguments = [command, "-quiet", f"-p={build / 'tidy'}", f"--config-file={ROOT / '.clang-tidy'}"]
    if len(source.files) > 1:
        arguments.append("-checks=-readability-duplicate-include")
    arguments += [f"-extra-arg={argument}" for argument in EXTRA]
    result = subprocess.run([*arguments, str(path)], capture_output=True, text=True)
    told = source.told(path, result.stdout)
    if result.returncode != 0 and not told:
        told = result.stderr  # clang-tidy itself failed
    return told + "".join(line for file in source.files if len(source.files) > 1 for line in included_twice(file))


def main():
    arguments = [each for each in sys.argv[1:] if each != "--all"]
    build = pathlib.Path(arguments[0]).resolve()
    jobs = int(arguments[1]) if len(arguments) > 1 else 1
    command, version, weight = subprocess.run([ROOT / "tests/clang_tool", "clang-tidy"], capture_output=True, text=True,
                                              check=True).stdout.split()
    sources = sources_of(build)
    changed = None if "--all" in sys.argv else changed_folders()
    if changed is not None:
        sources = {path: source for path, source in sources.items()
                   if any(file.parent in changed for file in source.files)}
    # The largest sources are first, because these sources take longest.
    order = sorted(sources, key=lambda path: -sum(file.stat().st_size for file in sources[path].files))
    found = 0
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for told in pool.map(lambda path: check(command, build, path, sources[path]), order):
            found += bool(told)
            sys.stdout.write(told)
    print(f"{sum(len(source.files) for source in sources.values())} files read as {len(sources)} by clang-tidy {version}, "
          f"{weight}")
    return 1 if found and weight == "binding" else 0


if __name__ == "__main__":
    sys.exit(main())
