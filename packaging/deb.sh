#!/usr/bin/env bash
# Makes the Debian package: the program with its page, manual pages, completions,
# robots, systemd unit and udev rules. Needs `cargo install --locked cargo-deb`,
# and for the microphone libasound2-dev and pkg-config.
# More for cargo deb as arguments, e.g. packaging/deb.sh --target aarch64-unknown-linux-gnu
set -euo pipefail
cd "$(dirname "$0")/.."

features=view,mic
made=packaging/generated
trap 'rm -rf "$made"' EXIT
cargo build --release --features "$features"
program=${CARGO_TARGET_DIR:-target}/release/servodance
rm -rf "$made"
"$program" man --out "$made/man"
"$program" completions bash > "$made/servodance.bash"
"$program" completions zsh > "$made/_servodance"
"$program" completions fish > "$made/servodance.fish"
cargo deb --strip --features "$features" "$@"
