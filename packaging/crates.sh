#!/usr/bin/env bash
# Shows that every crate can be published: packaging/crates.sh
# Each is packed, unpacked and built, in the order in which they would be published, against
# the others' packages in a registry that cargo makes for the purpose (without optimisation:
# nothing is run); none may have more than the 10 MB that crates.io takes; and no dependency
# may ask for a newer Rust than `rust-version` promises.
set -euo pipefail
cd "$(dirname "$0")/.."

most_bytes=10000000
packages=$(realpath -m "${CARGO_TARGET_DIR:-target}")/package
rm -f "$packages"/*.crate
# What has `publish = false` stays here. With candle, so that no file of its modules is missing.
export CARGO_PROFILE_DEV_DEBUG=false CARGO_INCREMENTAL=0
cargo package --workspace --exclude servodance-python --exclude servodance-web --locked \
    --features servodance/train,servodance-model/candle,servodance-training/candle "$@"
for crate in "$packages"/*.crate; do
    bytes=$(stat -c %s "$crate")
    printf '%-40s %9d bytes\n' "$(basename "$crate")" "$bytes"
    if [ "$bytes" -gt "$most_bytes" ]; then
        echo "that is more than $most_bytes" >&2
        exit 1
    fi
done
cargo metadata --format-version 1 --locked | python3 -c '
import json, sys
packages = json.load(sys.stdin)["packages"]
version = lambda text: tuple(int(n) for n in (text + ".0.0").split(".")[:3])
ours = next(p["rust_version"] for p in packages if p["name"] == "servodance")
newer = [p for p in packages if version(p["rust_version"] or "1") > version(ours)]
for p in newer:
    print(p["name"], p["version"], "asks for Rust", p["rust_version"], file=sys.stderr)
print("Rust", ours, "is enough for", len(packages) - len(newer), "of", len(packages), "packages")
sys.exit(bool(newer))'
