#!/usr/bin/env bash
# Runs the SocketCAN tests on a real Linux CAN stack: boots a small virtual
# machine (no KVM, one emulated processor) with a distribution kernel, a virtual
# CAN interface and the test binary, and passes only if every test in it did.
#
#   tests/vm/run.sh            everything; exit status 0 only if all tests passed
#   tests/vm/run.sh --install  first installs what it needs (Debian: qemu, busybox)
#
# The kernel package is downloaded and unpacked into target/vm, never installed.
set -euo pipefail
cd "$(dirname "$0")/../.."
work="${CARGO_TARGET_DIR:-target}/vm"
expected_tests=$(grep -c '#\[ignore' sim/tests/socketcan.rs)
mkdir -p "$work"

if [ "${1:-}" = --install ]; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
        qemu-system-x86 busybox-static cpio iproute2 >"$work/install.log" 2>&1 ||
        { cat "$work/install.log" >&2; exit 1; }
fi
for tool in qemu-system-x86_64 cpio ldd; do
    command -v "$tool" >/dev/null || { echo "$tool is missing: tests/vm/run.sh --install" >&2; exit 1; }
done

# The kernel: the newest one that the distribution's meta package names.
if ! ls "$work"/kernel/boot/vmlinuz-* >/dev/null 2>&1; then
    package=$(apt-cache depends linux-image-amd64 | sed -n 's/.*Depends: //p' | head -1)
    echo "VM: kernel package $package"
    rm -rf "$work/download" && mkdir -p "$work/download"
    (cd "$work/download" && apt-get download -qq "$package" 2>/dev/null)
    dpkg -x "$work"/download/*.deb "$work/kernel"
    rm -r "$work/download"
fi
kernel=$(ls "$work"/kernel/boot/vmlinuz-*)
modules=$(echo "$work"/kernel/lib/modules/*/kernel)

# The test binary, without running it.
cargo test --release -p servodance-sim --test socketcan --no-run --message-format=json 2>"$work/build.log" |
    grep -o '"executable":"[^"]*socketcan-[^"]*"' | cut -d'"' -f4 | tail -1 >"$work/binary" ||
    { cat "$work/build.log" >&2; exit 1; }
binary=$(cat "$work/binary")

# The root file system: busybox, the modules, the binary and its libraries.
root="$work/root"
rm -rf "$root" && mkdir -p "$root"/{bin,sbin,proc,sys,dev,tmp,tests,modules}
busybox=$(command -v busybox)
cp "$busybox" "$root/bin/busybox"
for applet in sh mount insmod cat uname ls echo basename poweroff; do ln -s busybox "$root/bin/$applet"; done
for module in net/can/can net/can/can-raw drivers/net/can/dev/can-dev drivers/net/can/vcan net/sched/sch_tbf; do
    cp "$modules/$module".ko* "$root/modules/"
    basename "$modules/$module".ko* >>"$root/modules/order"
done
cp "$binary" "$root/tests/socketcan"
for program in ip tc; do cp "$(PATH=$PATH:/sbin:/usr/sbin command -v $program)" "$root/sbin/"; done
for library in $(ldd "$binary" "$root"/sbin/* | grep -o '/[^ ]*' | grep -v ':$' | sort -u); do
    mkdir -p "$root$(dirname "$library")"
    cp -L "$library" "$root$library"
done
cp tests/vm/init "$root/init"
chmod +x "$root/init"
(cd "$root" && find . | cpio -o -H newc --quiet | gzip -1) >"$work/initrd.gz"

# Boot. The machine is given up after three minutes.
timeout 180 qemu-system-x86_64 -accel tcg -m 256 -nographic -nodefaults -no-reboot \
    -serial stdio -kernel "$kernel" -initrd "$work/initrd.gz" \
    -append "console=ttyS0 quiet panic=-1" </dev/null | tr -d '\r' | tee "$work/console.log"

# Only the guest's own words count: all tests ran, none failed, and it got to its end.
if grep -q "^test result: ok. $expected_tests passed; 0 failed" "$work/console.log" &&
    grep -q '^VM: socketcan exit 0$' "$work/console.log" && grep -q '^VM: end$' "$work/console.log"; then
    echo "VM: all $expected_tests SocketCAN tests passed"
else
    echo "VM: SocketCAN tests FAILED (wanted $expected_tests to pass)" >&2
    exit 1
fi
