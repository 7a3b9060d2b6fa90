"""What a frame costs on a 64-bit ARM processor, counted instead of timed.

    python model/reference/count_arm.py FRAMES [--kernels] [--frames]

FRAMES is the example `frames` of this crate, built for aarch64 without a dynamic loader
(docs/measurements/arm.md has the command). --kernels takes the innermost loops with vector
multiplications out of its disassembly and asks llvm-mca for their cycles on three cores.
--frames counts the instructions of a frame, own engine and candle: the difference between a
longer and a shorter dance. An emulator logs each instruction; if FRAMES is built for x86-64,
to stand beside, valgrind counts them.

Needs binutils-aarch64-linux-gnu, llvm-16, qemu-user-static; valgrind for x86-64 (Debian 12).
"""

import re
import subprocess
import sys

# LLVM 16 takes its Cortex-A57 for the first two; the third has a model of its own.
CORES = ("cortex-a72", "cortex-a76", "neoverse-n2")
MULTIPLIES = ("smull", "smlal", "fmla", "sdot", "fmul")
ITERATIONS = 200


def functions(program):
    """Name and instructions [(address, text)] of the functions that multiply vectors."""
    command = ["aarch64-linux-gnu-objdump", "-d", "-C", "--no-show-raw-insn", program]
    name, body = None, []
    for line in subprocess.Popen(command, stdout=subprocess.PIPE, text=True).stdout:
        if head := re.match(r"[0-9a-f]+ <(.*)>:$", line):
            if name:
                yield name, body
            name, body = head[1], []
        elif row := re.match(r"\s*([0-9a-f]+):\s+(.*)", line):
            body.append((int(row[1], 16), row[2].split("//")[0].strip()))
    if name:
        yield name, body


def loops(body):
    """The innermost loops: the instructions between a backward branch and its target."""
    place = {address: index for index, (address, _) in enumerate(body)}
    found = []
    for index, (address, text) in enumerate(body):
        branch = re.match(r"(b\.\w+|cbn?z\s+\w+,|tbn?z\s+\w+, #\d+,)\s*([0-9a-f]+)", text)
        start = place.get(int(branch[2], 16)) if branch else None
        if start is not None and start < index:
            found.append((start, index))
    inner = [a for a in found if not any(b != a and a[0] <= b[0] and b[1] <= a[1] for b in found)]
    return [[text for _, text in body[start : end + 1]] for start, end in inner]


def has_vectors(loop):
    words = [text.split()[0] for text in loop]
    return any(word.startswith(MULTIPLIES) for word in words)


def assembly(loop):
    """As llvm-mca reads it: branches to a label of its own, without symbols."""
    lines = []
    for text in loop:
        text = re.sub(r"<.*>", "", text).strip()
        text = re.sub(r"^(b\.\w+|cbn?z \w+,|cbn?z\s+\w+,|tbn?z\s+\w+, #\d+,)\s*[0-9a-f]+", r"\1 top", text)
        lines.append(text)
    return "top:\n" + "\n".join(lines) + "\n"


def cycles(loop, core):
    """Cycles of one turn of the loop; None if llvm-mca cannot read it."""
    command = ["llvm-mca-16", "-mtriple=aarch64", f"-mcpu={core}", f"-iterations={ITERATIONS}"]
    run = subprocess.run(command, input=assembly(loop), capture_output=True, text=True)
    total = re.search(r"Total Cycles:\s+(\d+)", run.stdout)
    return int(total[1]) / ITERATIONS if total else None


def kernels(program):
    """The loop of each function that multiplies most: the one that long rows run through."""
    print("| kernel | instructions of a turn | " + " | ".join(CORES) + " |")
    print("|---|---|" + "---|" * len(CORES))
    for name, body in functions(program):
        kernel = re.search(r"servodance_model::engine::kernels::(\w+)$", name)
        own = [loop for loop in loops(body) if has_vectors(loop)] if kernel else []
        if own:
            loop = max(own, key=lambda loop: sum(t.split()[0].startswith(MULTIPLIES) for t in loop))
            counted = " | ".join(f"{cycles(loop, core):.1f}" for core in CORES)
            print(f"| {kernel[1]} | {len(loop)} | {counted} |")


def is_x86_64(program):
    with open(program, "rb") as file:
        return int.from_bytes(file.read(20)[18:], "little") == 62  # e_machine of ELF


def instructions(program, *arguments):
    """Executed instructions of a whole run."""
    if is_x86_64(program):
        command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", program]
        run = subprocess.run([*command, *arguments], capture_output=True, text=True, check=True)
        return int(re.search(r"Collected : (\d+)", run.stderr)[1])
    command = ["qemu-aarch64-static", "-singlestep", "-d", "nochain,exec", "-D", "/dev/stdout"]
    logged = subprocess.Popen([*command, program, *arguments], stdout=subprocess.PIPE)
    counted = subprocess.run(["grep", "-ac", "^Trace"], stdin=logged.stdout, capture_output=True, text=True)
    return int(counted.stdout)


def frames(program):
    print("| engine, format | instructions a frame |")
    print("|---|---|")
    for words in (["q8_0"], ["f16"], ["f32"], ["f32", "candle"]):
        long, short = (instructions(program, str(n), *words) for n in (4, 2))
        print(f"| {' '.join(words)} | {(long - short) / 2 / 1e6:.2f} million |", flush=True)


def main():
    program, options = sys.argv[1], sys.argv[2:]
    if "--kernels" in options:
        kernels(program)
    if "--frames" in options:
        frames(program)


if __name__ == "__main__":
    main()
