#!/usr/bin/env bash
# Builds the wheel, installs it into an empty virtual environment of each interpreter given
# (python3 if none), and runs the README's code and its tests there.
# SERVODANCE names the program that results are compared with.
set -euo pipefail
cd "$(dirname "$0")"
: "${SERVODANCE:?name the servodance program to compare with}"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/build"
"$work/build/bin/pip" install --quiet 'maturin>=1.9,<2'
"$work/build/bin/maturin" build --release --locked --quiet --out "$work/wheels"
ls -l "$work"/wheels/*.whl
sed -n '/^```python/,/^```/p' README.md | sed '/^```/d' > "$work/tutorial.py"
for python in "${@:-python3}"; do
    "$python" -m venv "$work/venv"
    "$work/venv/bin/python" --version
    began=$(date +%s.%N)
    "$work/venv/bin/pip" install --quiet "$work"/wheels/*.whl
    installed=$(date +%s.%N)
    (cd "$work" && "$work/venv/bin/python" tutorial.py)
    echo "$began $installed $(date +%s.%N)" |
        awk '{ printf "pip install %.1f s, the README'"'"'s dances %.1f s\n", $2 - $1, $3 - $2 }'
    (cd "$work" && SERVODANCE="$SERVODANCE" "$work/venv/bin/python" "$OLDPWD/tests/test_servodance.py")
    rm -rf "$work/venv"
done
