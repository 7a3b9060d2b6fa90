"""Brings the public descriptions of a list to a folder outside this repository.

    python tests/robots/gather.py tests/robots/public.txt FOLDER [--mirrors DIR]

FOLDER gets a folder a repository, with descriptions and their meshes as they are at the
commit that the list names. --mirrors: a folder of Git repositories `OWNER+NAME/repo`;
without it each comes from github.com. Files that end in .xacro are expanded (PyPI: xacro)
to the same name without that ending. Files that a mirror lacks are told and left out.
"""

import argparse
import subprocess
import sys
from pathlib import Path

KEPT = (".urdf", ".xml", ".xacro", ".gazebo", ".stl", ".obj", ".dae", ".glb", ".yaml")


def read_list(path):
    """Rows of `repository`, `commit`, `file`, `kind`, `parts` (link by part)."""
    rows, repository, commit = [], None, None
    for line in Path(path).read_text().splitlines():
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if words[0].startswith("["):
            repository, commit = line.strip("[]").split()
            continue
        parts = dict(word.split("=", 1) for word in words[2:])
        rows.append({"repository": repository, "commit": commit, "file": words[0], "kind": words[1],
                     "parts": parts})
    return rows


def place_of(folder, row):
    """Where a row's description lies in the folder."""
    name = row["file"].removesuffix(".xacro")
    return Path(folder) / row["repository"].split("/")[1] / name


def git(folder, *words, given=None):
    done = subprocess.run(["git", "--git-dir", str(folder), *words], input=given, capture_output=True)
    if done.returncode:
        sys.exit(f"git {' '.join(words[:2])} in {folder}: {done.stderr.decode().strip()}")
    return done.stdout


def repository_at(mirrors, scratch, repository, commit):
    if mirrors:
        found = Path(mirrors) / repository.replace("/", "+") / "repo"
        return found / ".git" if (found / ".git").is_dir() else found
    folder = scratch / (repository.replace("/", "+") + ".git")
    if not folder.exists():
        subprocess.run(["git", "init", "--bare", "--quiet", str(folder)], check=True)
        git(folder, "fetch", "--depth", "1", f"https://github.com/{repository}", commit)
    return folder


def files_of(folder, commit):
    """Path and bytes of every file that is kept; what is missing is told."""
    wanted = []
    for line in git(folder, "ls-tree", "-r", "-z", commit).decode(errors="replace").split("\0"):
        if line and line.lower().endswith(KEPT):
            about, path = line.split("\t", 1)
            wanted.append((about.split()[2], path))
    asked = "\n".join(name for name, _ in wanted).encode()
    told, at, missing = git(folder, "cat-file", "--batch", given=asked), 0, 0
    for _, path in wanted:
        end = told.index(b"\n", at)
        words = told[at:end].split()
        at = end + 1
        if words[1] == b"missing":
            missing += 1
            continue
        size = int(words[2])
        yield path, told[at:at + size]
        at += size + 1
    if missing:
        print(f"{folder}: {missing} files are missing")


def expand(source, folder, out):
    """A xacro file as the URDF that it stands for; packages are looked for in `folder`."""
    import xacro
    from xacro import substitution_args

    def found(package):
        places = [folder, *sorted(folder.rglob(package))]
        at = next((at for at in places if at.is_dir() and at.name == package), None)
        if at is None:
            raise FileNotFoundError(f"no package {package}")
        return str(at)

    substitution_args._eval_find = found
    try:
        out.write_text(xacro.process_file(str(source)).toprettyxml(indent=" "))
    except xacro.XacroException as error:
        print(f"{source}: {error}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("list")
    parser.add_argument("folder")
    parser.add_argument("--mirrors")
    args = parser.parse_args()
    folder = Path(args.folder).resolve()
    rows = read_list(args.list)
    for repository, commit in dict.fromkeys((row["repository"], row["commit"]) for row in rows):
        at = repository_at(args.mirrors, folder, repository, commit)
        for path, data in files_of(at, commit):
            out = folder / repository.split("/")[1] / path
            out.parent.mkdir(parents=True, exist_ok=True)
            out.write_bytes(data)
    for row in rows:
        if row["file"].endswith(".xacro"):
            source = folder / row["repository"].split("/")[1] / row["file"]
            expand(source, folder, place_of(folder, row))
    lacking = [str(place_of(folder, row)) for row in rows if not place_of(folder, row).exists()]
    print(f"{len(rows) - len(lacking)} descriptions in {folder}")
    if lacking:
        sys.exit("missing: " + ", ".join(lacking))


if __name__ == "__main__":
    main()
