"""Whether all of a kernel is compiled for the instructions that it is chosen for: no part of one calls `fma`.

    python scripts/trust/kernels.py target/release/marsyard

Kernels are compiled once for each instruction set (src/wide.rs, src/train/filter/lanes), and are there whole only if what they call becomes part of
them. What does not is compiled for any x86-64, where a fused multiply-add is a call of a function: training took six times as long when the
logistic function was such a part, and no bit told it. The plain form of a kernel calls `fma` rightly; it lies in the function that chooses
between the forms. Found are calls out of a form for AVX2 or AVX-512, or out of a shim of the standard library.

Needs nm, readelf and objdump, from binutils. Exit 1 with every such function.
"""

import platform
import re
import subprocess
import sys

CALLED = ("fma", "fmaf")
#: Functions that have no business to call them.
WRONG = re.compile(r"^<?(core|alloc|std)::|::(avx2|avx512)$")


def lines(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()


def callers(binary):
    """Functions that call `fma` or `fmaf`, directly or by a table of addresses."""
    symbols = (line.split() for line in lines("nm", binary))
    of_address = {int(fields[0], 16): fields[2] for fields in symbols if len(fields) == 3 and fields[2] in CALLED}
    relocations = (line.split() for line in lines("readelf", "--relocs", "--wide", binary))
    relative = [fields for fields in relocations if len(fields) == 4 and fields[2] == "R_X86_64_RELATIVE"]
    entries = {int(fields[0], 16) for fields in relative if int(fields[3], 16) in of_address}
    found, name = set(), None
    for line in lines("objdump", "--disassemble", "--demangle", "--no-show-raw-insn", binary):
        if begin := re.match(r"[0-9a-f]+ <(.*)>:$", line):
            name = begin[1]
        elif entry := re.search(r"# ([0-9a-f]+) <", line):
            found |= {name} if int(entry[1], 16) in entries else set()
        elif call := re.search(r"\s(?:call|jmp)\s+([0-9a-f]+) <", line):
            found |= {name} if int(call[1], 16) in of_address else set()
    return found - set(CALLED)


def main(binary):
    if platform.machine() != "x86_64":
        print(f"NOT CHECKED: fused multiply-adds are instructions of every {platform.machine()}")
        return
    found = callers(binary)
    if not any(name.startswith("marsyard::") for name in found):
        sys.exit(f"{binary}: not even plain forms of kernels call {' or '.join(CALLED)}; the binary has no symbols, or this check is out of date")
    wrong = sorted(name for name in found if WRONG.search(name))
    print(f"{binary}: {len(found)} functions call {' or '.join(CALLED)}, none of them in a form for AVX" if not wrong else
          f"{binary}: parts of kernels that are compiled for any x86-64:\n" + "\n".join(f"  {name}" for name in wrong))
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main(sys.argv[1])
