#!/usr/bin/env bash
# Unpacks a Debian package and runs what is in it: doctor, dance, and a scan of the
# simulated servos of two robots: packaging/try.sh servodance_0.1.0-1_arm64.deb
# A package of another architecture runs under qemu-user (Debian: qemu-user-static, and
# libc6, libasound2 of that architecture). qemu 7.2 knows no serial ports of any baud rate
# (TCGETS2), so that the servos are behind a socket.
set -euo pipefail

package=$(realpath "$1")
work=$(mktemp -d)
buses=()
trap 'kill "${buses[@]}" 2>/dev/null || true; rm -rf "$work"' EXIT
dpkg-deb -x "$package" "$work"
cd "$work"

case $(dpkg-deb -f "$package" Architecture) in
    "$(dpkg --print-architecture)") runner=() ;;
    arm64) runner=(qemu-aarch64-static) ;;
    amd64) runner=(qemu-x86_64-static) ;;
esac
servodance() {
    "${runner[@]}" usr/bin/servodance "$@"
}

# scan ROBOT LINK SCHEME PATTERN COUNT: its first bus answers with so many lines of a pattern.
scan() {
    (exec "${runner[@]}" usr/bin/servodance sim-bus --robot "$1" --link "$2") > "$1.bus" &
    buses+=($!)
    until [ -s "$1.bus" ]; do sleep 0.1; done
    servodance scan "$3$(sed -n '1s/.*=//;1p' "$1.bus")" > "$1.scan" 2> "$1.said"
    local found
    found=$(grep -c "$4" "$1.scan" || true)
    echo "scan of $1 by $2: $found found"
    [ "$found" = "$5" ] || { cat "$1.scan" "$1.said" >&2; exit 1; }
}

servodance --version
servodance doctor
scan op3 unix "" "57600 baud .* XM430-W350" 20
scan lite22 udp udp: "id" 5
servodance dance | tee dance.txt
grep -q "broken at the servos: position 0, velocity 0, acceleration 0" dance.txt
grep -q "stayed on its feet" dance.txt
echo "tried: $(basename "$package")"
