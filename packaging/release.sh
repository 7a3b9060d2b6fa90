#!/usr/bin/env bash
# Makes what people install, with all features: a tarball and a Debian package for each
# architecture, and SHA256SUMS: packaging/release.sh [FOLDER [amd64|arm64 ...]]
# The same commit and the same compilers give the same bytes. Needs on Debian 12:
#   apt-get install --no-install-recommends libasound2-dev pkg-config
# and for arm64, because rustup's toolchains may come without that standard library:
#   dpkg --add-architecture arm64 && apt-get update
#   apt-get install --no-install-recommends rustc-web libstd-rust-web-dev:arm64 \
#       libasound2-dev:arm64 gcc-aarch64-linux-gnu libc6-dev-arm64-cross
set -euo pipefail
cd "$(dirname "$0")/.."

folder=$(realpath -m "${1:-dist/release}")
shift || true
architectures=("${@:-amd64}")
[ $# -gt 0 ] || architectures=(amd64 arm64)
features=mic,speaker,view,stage,train
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH
built=$(realpath -m "${CARGO_TARGET_DIR:-target}")/release-packages
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# No path of this machine stands in the program.
export RUSTFLAGS="--remap-path-prefix=$PWD=. --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=cargo --remap-path-prefix=$built=target"
mkdir -p "$folder"

target_of() {
    case $1 in
        amd64) echo x86_64-unknown-linux-gnu ;;
        arm64) echo aarch64-unknown-linux-gnu ;;
        *) echo "unknown architecture $1: amd64 or arm64" >&2; exit 2 ;;
    esac
}

build() {
    local target
    target=$(target_of "$1")
    local own=(env "CARGO_TARGET_DIR=$built")
    if [ "$1" = arm64 ]; then
        own+=(RUSTC=/usr/bin/rustc PKG_CONFIG_ALLOW_CROSS=1
            PKG_CONFIG_PATH=/usr/lib/aarch64-linux-gnu/pkgconfig
            CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc)
    fi
    "${own[@]}" cargo build --release --locked --bin servodance --features "$features" --target "$target"
}

# Everything below the prefix (/usr, /usr/local): fill PREFIX ARCHITECTURE.
fill() {
    local strip=strip
    [ "$1" != arm64 ] || strip=aarch64-linux-gnu-strip
    local to=$2
    install -D "$built/$(target_of "$1")/release/servodance" "$to/bin/servodance"
    $strip --strip-all "$to/bin/servodance"
    mkdir -p "$to"/share/{man/man1,bash-completion/completions,zsh/vendor-completions} \
        "$to"/share/{fish/vendor_completions.d,servodance/robots,doc/servodance} "$to"/lib/{systemd/system,udev/rules.d}
    cp "$work"/man/*.1 "$to/share/man/man1/"
    gzip -9n "$to"/share/man/man1/*.1
    cp "$work/bash" "$to/share/bash-completion/completions/servodance"
    cp "$work/zsh" "$to/share/zsh/vendor-completions/_servodance"
    cp "$work/fish" "$to/share/fish/vendor_completions.d/servodance.fish"
    cp configs/[a-z]*.toml configs/*.urdf configs/*.json "$to/share/servodance/robots/"
    cp -r README.md docs model/MODEL_CARD.md "$to/share/doc/servodance/"
    gzip -9nc CHANGELOG.md > "$to/share/doc/servodance/changelog.gz"
    cp packaging/copyright "$to/share/doc/servodance/"
    cp packaging/servodance.service "$to/lib/systemd/system/"
    cp packaging/60-servodance.rules "$to/lib/udev/rules.d/"
    find "$to" -type d -exec chmod 755 {} +
    find "$to" -type f ! -path '*/bin/*' -exec chmod 644 {} +
    find "$to" -exec touch -hd "@$SOURCE_DATE_EPOCH" {} +
}

tarball() {
    local name
    name=servodance-$version-$(target_of "$1")
    fill "$1" "$work/$name"
    tar -C "$work" --sort=name --owner=0 --group=0 --numeric-owner --mtime="@$SOURCE_DATE_EPOCH" -c "$name" |
        gzip -9n > "$folder/$name.tar.gz"
    echo "$folder/$name.tar.gz"
}

# The C library that the program asks for at least.
libc_of() {
    objdump -T "$1" | grep -o 'GLIBC_[0-9.]*' | sort -uV | tail -1 | cut -d_ -f2
}

package() {
    local root=$work/root-$1
    fill "$1" "$root/usr"
    local documents=$root/usr/share/doc/servodance
    printf 'servodance (%s-1) unstable; urgency=medium\n\n  * See changelog.gz.\n\n -- %s  %s\n' "$version" \
        "$(sed -n 's/^Maintainer: //p' packaging/control)" "$(date -Rud "@$SOURCE_DATE_EPOCH")" |
        gzip -9n > "$documents/changelog.Debian.gz"
    install -Dm644 packaging/lintian-overrides "$root/usr/share/lintian/overrides/servodance"
    mkdir "$root/DEBIAN"
    sed -e "s/@VERSION@/$version-1/" -e "s/@ARCHITECTURE@/$1/" \
        -e "s/@LIBC@/$(libc_of "$root/usr/bin/servodance")/" \
        -e "s/@KILOBYTES@/$(du -sk --apparent-size "$root/usr" | cut -f1)/" packaging/control > "$root/DEBIAN/control"
    (cd "$root" && find usr -type f -print0 | sort -z | xargs -0 md5sum) > "$root/DEBIAN/md5sums"
    chmod 755 "$root/DEBIAN" "$root"
    find "$root" -exec touch -hd "@$SOURCE_DATE_EPOCH" {} +
    dpkg-deb --root-owner-group -Zxz -b "$root" "$folder/servodance_$version-1_$1.deb"
}

# The manual pages and completions come from the program of this machine.
build "$(dpkg --print-architecture)"
program=$built/$(target_of "$(dpkg --print-architecture)")/release/servodance
"$program" man --out "$work/man"
for shell in bash zsh fish; do "$program" completions $shell > "$work/$shell"; done

for architecture in "${architectures[@]}"; do
    build "$architecture"
    tarball "$architecture"
    package "$architecture"
done
(cd "$folder" && sha256sum -- *.tar.gz *.deb > SHA256SUMS && cat SHA256SUMS)
