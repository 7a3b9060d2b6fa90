#!/usr/bin/env bash
# Builds the dance for browsers into one static folder: packaging/web.sh [FOLDER]
# (docs/guides/browser.md). Needs on Debian:
#   apt-get install --no-install-recommends rustc-web rust-web-src lld
# and cargo. The standard library is built for WebAssembly from Debian's sources, because
# rustup's toolchains may come without it. RUSTC_WEB names another compiler for WebAssembly.
set -euo pipefail
cd "$(dirname "$0")/.."

folder=${1:-dist/web}
# In all, as the page promises.
most_bytes=15000000
target=wasm32-unknown-unknown
# Absolute: it must not depend on the folder.
made=$(realpath -m "${CARGO_TARGET_DIR:-target}")
export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=wasm-ld

# The flag of `getrandom` says that there are no random numbers: all come from the seed.
RUSTC=${RUSTC_WEB:-/usr/bin/rustc} RUSTC_BOOTSTRAP=1 \
RUSTFLAGS='-C target-feature=+simd128 --cfg getrandom_backend="unsupported"' \
    cargo build --profile web --lib -p servodance-web --target "$target" -Zbuild-std=std,panic_abort

mkdir -p "$folder"
cp "$made/$target/web/servodance_web.wasm" "$folder/dance.wasm"
cp model/weights/dance.safetensors "$folder/weights.safetensors"
# The viewer's own modules, and those of this page alone.
for module in stage.js robot.js floor.js pixels.js painter.js camera.js matrix.js shapes.js view.css; do
    cp "runtime/src/viewer/page/$module" "$folder/"
done
cp web/page/* "$folder/"

bytes=$(find "$folder" -type f -printf '%s\n' | awk '{ sum += $1 } END { print sum }')
echo "$folder: $bytes bytes"
if [ "$bytes" -gt "$most_bytes" ]; then
    echo "that is more than $most_bytes" >&2
    exit 1
fi
